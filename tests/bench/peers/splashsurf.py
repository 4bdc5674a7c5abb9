"""splashsurf: surface reconstruction for SPH particles by marching cubes (Löschner et al. 2023)."""

from __future__ import annotations

from typing import Any

import numpy as np

from .peer import Case, Mesh, Stopwatch, Task

PARTICLE_RADIUS = 0.25
"""R by four: particles two of their radii apart, and an SPH kernel that reaches four of them, which is R."""
_SETTINGS: dict[str, Any] = {"smoothing_length": 2.0, "cube_size": 0.5, "iso_surface_threshold": 0.6}
# As in the example of its own manual.
_POST_PROCESSING = {
    "mesh_cleanup": True,
    "mesh_smoothing_weights": True,
    "mesh_smoothing_weights_normalization": 13.0,
    "mesh_smoothing_iters": 25,
    "compute_normals": True,
    "normals_smoothing_iters": 10,
}
_REMARK = "another field by design, an SPH density that allows for the number of neighbours, so it is not judged by ours"

CASES = (
    Case("splashsurf", "splashsurf, cube 0.5", "poly6", 0.2, "none", "mesh", _REMARK),
    Case(
        "splashsurf",
        "splashsurf with clean-up, smoothing, normals",
        "poly6",
        0.2,
        "none",
        "mesh",
        f"{_REMARK}; smoothing moves it further",
        _POST_PROCESSING,
    ),
)


class Splashsurf:
    """The particles, which it takes as an array."""

    def __init__(self, task: Task) -> None:
        # Imported here because the cases are read where it is not installed.
        import pysplashsurf

        self._reconstruct = pysplashsurf.reconstruction_pipeline
        self._positions = task.positions
        self._options = dict(task.options)
        self._result: Any = None

    def surface(self) -> dict[str, float]:
        watch = Stopwatch()
        with watch.stage("surface"):
            self._result, _ = self._reconstruct(self._positions, particle_radius=PARTICLE_RADIUS, **_SETTINGS, **self._options)
        return watch.milliseconds

    def mesh(self) -> Mesh:
        mesh = self._result.mesh
        normals = self._result.point_attributes.get("normals")
        if normals is None:
            normals = mesh.vertex_normals_parallel()
        return Mesh(
            np.asarray(mesh.vertices, np.float32), np.asarray(normals, np.float32), np.asarray(mesh.triangles, np.int32)
        )


create = Splashsurf
