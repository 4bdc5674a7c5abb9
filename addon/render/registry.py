"""The methods there are. A new one is its folder and one line here."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from ..fluid.errors import DeviceError, InputError
from .method import Backend, Method, MethodInfo

_PACKAGE = __package__.rpartition(".addon.")[0]

# Folders with `params.py` (METHOD, loads nothing heavy) and `method.py` (create()); the preferred first.
_FOLDERS = (
    "gpu_shaders.methods.tile_lists",
    "addon.render.tile_caster",
    "gpu_shaders.methods.fitted_bvh",
    "gpu_shaders.methods.depth_peeling",
    # Those that sample come last: none is taken for what the others can draw.
    "gpu_shaders.methods.equal_interval",
    "gpu_shaders.methods.vicinity",
    "gpu_shaders.methods.walking_depth_plane",
    "gpu_shaders.methods.surface_particles",
    "addon.render.disc_caster",
    # What is no metaballs.
    "gpu_shaders.methods.glyphs",
    "addon.render.glyph_caster",
)


@dataclass(frozen=True)
class MethodStatus:
    """A registered method, and whether it can run on this machine.

    Attributes
    ----------
    info
        What it is.
    problem
        One sentence that says why it cannot run here, empty if it can.
    """

    info: MethodInfo
    problem: str

    @property
    def name(self) -> str:
        """Identifier of the method."""
        return self.info.name

    @property
    def label(self) -> str:
        """What the user interface calls it."""
        return self.info.label

    @property
    def description(self) -> str:
        """What it is, for tooltips."""
        return self.info.description

    @property
    def backend(self) -> Backend:
        """The back-end that it belongs to."""
        return self.info.backend


def _import(folder: str, module: str) -> Any:
    return importlib.import_module(f"{_PACKAGE}.{folder}.{module}")


def method_infos(display: str | None = None) -> list[MethodInfo]:
    """All registered methods, or those that show balls in one way (:data:`displays.DISPLAYS`), in order of preference.

    Loads no GPU module, so the interface may call it at start.
    """
    infos: list[MethodInfo] = [_import(folder, "params").METHOD for folder in _FOLDERS]
    return [info for info in infos if display is None or display in info.displays]


def method_info(name: str) -> MethodInfo:
    """What the method called `name` is, without loading it; raises InputError where there is none."""
    for info in method_infos():
        if info.name == name:
            return info
    raise InputError(f"Unknown method '{name}': choose auto, {', '.join(info.name for info in method_infos())}")


def methods() -> list[MethodStatus]:
    """All registered methods, in order of preference, and whether each runs here. Opens the GPU to find out."""
    return [MethodStatus(info, _problem(info)) for info in method_infos()]


def create_method(name: str) -> tuple[MethodInfo, Method]:
    """The method called `name`, ready to run.

    Raises
    ------
    InputError
        There is no such method.
    DeviceError
        It cannot run on this machine.
    """
    info = method_info(name)
    if info.backend == "gpu":
        gpu()
    folder = next(folder for folder in _FOLDERS if _import(folder, "params").METHOD.name == name)
    return info, _import(folder, "method").create()


def gpu() -> ModuleType:
    """The module that owns the OpenGL context; raises DeviceError where its packages are missing."""
    try:
        return importlib.import_module(f"{_PACKAGE}.gpu_shaders.context")
    except ImportError as error:
        raise DeviceError(f"OpenGL cannot be used because a package is missing ({error}); reinstall the extension") from error


def tracing_stage() -> ModuleType:
    """The module that traces light on the graphics processor; raises DeviceError where packages are missing."""
    gpu()
    return importlib.import_module(f"{_PACKAGE}.gpu_shaders.tracing.images")


def runs_in_software_opengl(info: MethodInfo) -> bool:
    """Whether the method would run through an OpenGL that is itself only software; DeviceError where there is none."""
    return info.backend == "gpu" and bool(gpu().shared_context().is_software)


def _problem(info: MethodInfo) -> str:
    try:
        create_method(info.name)
    except DeviceError as error:
        return str(error)
    return ""
