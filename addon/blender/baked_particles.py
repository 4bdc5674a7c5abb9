"""Surface particles in files: a PLY file for each frame, which other programs and Blender's own importer read, too."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ..fluid.errors import InputError
from ..output.file_names import frame_path
from ..output.ply import read_points, write_points
from .particle_mesh import ATTRIBUTES, Columns

_VECTORS = {"position": ("x", "y", "z"), "surface_normal": ("nx", "ny", "nz"), "velocity": ("vx", "vy", "vz")}
_NUMBERS = ("radius", "id")


def pattern_for(mesh: bpy.types.Mesh) -> str:
    """The name of the files that a bake makes, with ``####`` for the frame number; ``//`` is the folder of the .blend file.

    Raises
    ------
    InputError
        The folder is relative to a file that was never saved.
    """
    folder = mesh.meniscus.bake_folder
    if folder.startswith("//") and not bpy.data.filepath:
        raise InputError("The folder of the bake is relative to the .blend file: save that first, or choose an absolute folder")
    separator = "" if folder.endswith(("/", "\\")) else "/"
    return f"{folder}{separator}{bpy.path.clean_name(mesh.name)}_####.ply"


def baked_path(pattern: str, frame: int) -> Path:
    """The file of a frame."""
    return frame_path(bpy.path.abspath(pattern), frame)


def write_particles(path: Path, columns: Columns) -> None:
    """Write a frame; OutputError says why it cannot be written."""
    vectors = {axis: columns[name][:, number] for name, axes in _VECTORS.items() for number, axis in enumerate(axes)}
    write_points(path, {**vectors, **{name: columns[name] for name in _NUMBERS}})


def read_particles(path: Path, seconds: float = 0.0) -> Columns:
    """The particles of a frame, moved by their velocities to a time so much later; OutputError where they cannot be read."""
    found = read_points(path, (*(axis for axes in _VECTORS.values() for axis in axes), *_NUMBERS))
    columns = {name: np.stack([found[axis] for axis in axes], axis=1) for name, axes in _VECTORS.items()}
    columns |= {name: found[name] for name in _NUMBERS}
    columns["position"] = columns["position"] + np.float32(seconds) * columns["velocity"]
    return {name: columns[name].astype(dtype) for name, (_, _, dtype) in ATTRIBUTES.items()}
