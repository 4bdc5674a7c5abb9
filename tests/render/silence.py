"""What the render tests expect of the driver: that it has nothing to say against the use of OpenGL."""

from __future__ import annotations


def check_silence(context):
    """Fail with what the driver has said since the last check; a test that provokes it takes the messages itself."""
    messages = context.debug_messages()
    assert not messages, f"The driver complains: {'; '.join(messages)}"
