"""The errors that a user can act on. Each message is one sentence: what is wrong and what to do."""


class MeniscusError(Exception):
    """Base of all errors whose message is meant for the user."""


class InputError(MeniscusError, ValueError):
    """The scene, the arrays or the options cannot be used as given."""


class GoneError(InputError):
    """What was to be rendered has been removed: there is no going on."""


class DeviceError(MeniscusError):
    """The graphics device or its driver cannot do what was asked."""


class OutputError(MeniscusError):
    """A file cannot be written or read."""


class FullDiskError(OutputError):
    """There is no room for a file, nor for those after it."""


class CancelledError(MeniscusError):
    """The user cancelled the work."""
