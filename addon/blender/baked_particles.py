"""Surface particles in files: a PLY file for each frame, which other programs and Blender's own importer read, too."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ..fluid.errors import InputError
from ..output.file_names import frame_path
from ..output.ply import read_points, write_points
from ..render.surface_particles import ParticleCloud
from .particle_mesh import RADIUS_SHARE

_VECTORS = {"positions": ("x", "y", "z"), "normals": ("nx", "ny", "nz"), "velocities": ("vx", "vy", "vz")}
_NAMES = (*(axis for axes in _VECTORS.values() for axis in axes), "radius", "id")


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


def write_particles(path: Path, cloud: ParticleCloud) -> None:
    """Write a frame; OutputError says why it cannot be written."""
    columns = {axis: getattr(cloud, name)[:, number] for name, axes in _VECTORS.items() for number, axis in enumerate(axes)}
    write_points(path, {**columns, "radius": np.float32(RADIUS_SHARE) * cloud.spacings, "id": cloud.ids.view(np.int32)})


def read_particles(path: Path, seconds: float = 0.0) -> ParticleCloud:
    """The particles of a frame, moved by their velocities to a time so much later; OutputError where they cannot be read."""
    columns = read_points(path, _NAMES)
    vectors = {name: np.stack([columns[axis] for axis in axes], axis=1).astype(np.float32) for name, axes in _VECTORS.items()}
    vectors["positions"] += np.float32(seconds) * vectors["velocities"]
    spacings = columns["radius"].astype(np.float32) / np.float32(RADIUS_SHARE)
    return ParticleCloud(**vectors, spacings=spacings, ids=columns["id"].astype(np.int32).view(np.uint32))
