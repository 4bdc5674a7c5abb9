"""What Rendered viewports of the render engine show beside the fluid: the world and plainly shaded meshes.

Blender's view transform comes after it, so that colours are scene-linear. The fluid itself is drawn by viewport.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import bpy
import gpu
import numpy as np
import numpy.typing as npt
from gpu_extras.batch import batch_for_shader

from ..fluid.lighting import Lighting
from ..fluid.meshes import Meshes
from ..render.material_shading import shade_points


@contextmanager
def view_matrices(view: bpy.types.RegionView3D) -> Iterator[None]:
    """Draw with the matrices of a view."""
    with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_matrix(view.view_matrix)
        gpu.matrix.load_projection_matrix(view.window_matrix)
        yield


class RenderedMeshes:
    """Draws the meshes of one scene into one viewport; made anew where they or their light have changed."""

    def __init__(self, meshes: Meshes, lighting: Lighting) -> None:
        self._shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        self._sides: list[tuple[str, gpu.types.GPUBatch]] = []
        if len(meshes):
            corners = meshes.vertices[meshes.triangles].reshape(-1, 3)
            for hidden, sign in (("BACK", 1.0), ("FRONT", -1.0)):
                colors = _corner_colors(meshes, lighting, corners, sign)
                batch = batch_for_shader(self._shader, "TRIS", {"pos": corners, "color": colors})
                self._sides.append((hidden, batch))

    def draw(self, are_holdouts: bool) -> None:
        """Draw into the view whose matrices hold, or only its depth; Blender's state of drawing is left as it was found."""
        test, mask = gpu.state.depth_test_get(), gpu.state.depth_mask_get()
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        gpu.state.color_mask_set(*[not are_holdouts] * 4)
        try:
            self._shader.bind()
            for hidden, batch in self._sides:
                gpu.state.face_culling_set(hidden)
                batch.draw(self._shader)
        finally:
            gpu.state.face_culling_set("NONE")
            gpu.state.color_mask_set(True, True, True, True)
            gpu.state.depth_test_set(test)
            gpu.state.depth_mask_set(mask)


def _corner_colors(
    meshes: Meshes, lighting: Lighting, corners: npt.NDArray[np.float32], sign: float
) -> npt.NDArray[np.float32]:
    """(corners, 4) of one side: as renders shade them, but for gloss, which would turn with the view."""
    normals = sign * meshes.normals.reshape(-1, 3)
    materials = np.repeat(meshes.material, 3)
    base = np.array([material.color for material in meshes.materials], np.float32)[materials]
    dull = tuple(replace(material, roughness=1.0, transmission=0.0) for material in meshes.materials)
    radiance = shade_points(corners, normals, base, materials, dull, lighting)
    return np.concatenate([radiance, np.ones((len(radiance), 1), np.float32)], axis=1)
