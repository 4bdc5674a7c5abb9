"""The image of the world behind everything in Rendered viewports of the render engine."""

from __future__ import annotations

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..fluid.lighting import Lighting
from ..render.tracing import world_seen
from .texture_sharing import uploaded
from .view_camera import whole_view

_CORNERS = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
_PLACES = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]

_MOVING_DIVISOR = 3
"""By which images of views that change are smaller than the viewport."""


class WorldBackground:
    """Draws the image of a world into one viewport, coarse while the view changes."""

    def __init__(self, lighting: Lighting) -> None:
        self.lighting = lighting
        self._seen: tuple[object, ...] = ()
        self._is_fine = False
        self._texture: gpu.types.GPUTexture | None = None
        self._shader = gpu.shader.from_builtin("IMAGE")
        self._batch = batch_for_shader(self._shader, "TRI_STRIP", {"pos": _CORNERS, "texCoord": _PLACES})

    def draw(self) -> None:
        """Draw into the view whose matrices hold; Blender's state of drawing is left as it was found."""
        self._look()
        test, mask = gpu.state.depth_test_get(), gpu.state.depth_mask_get()
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(False)
        try:
            with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
                gpu.matrix.load_identity()
                gpu.matrix.load_projection_matrix(Matrix())
                self._shader.bind()
                self._shader.uniform_sampler("image", self._texture)
                self._batch.draw(self._shader)
        finally:
            gpu.state.depth_test_set(test)
            gpu.state.depth_mask_set(mask)

    def _look(self) -> None:
        """Bring the texture up to date."""
        _, _, width, height = gpu.state.viewport_get()
        matrices = gpu.matrix.get_model_view_matrix(), gpu.matrix.get_projection_matrix()
        seen = (*matrices, width, height)
        is_same = seen == self._seen
        if is_same and self._is_fine:
            return
        divisor = 1 if is_same else _MOVING_DIVISOR
        camera = whole_view(*matrices, width, height, np.zeros((2, 3))).camera
        pixels = world_seen(camera.resized(-(-width // divisor), -(-height // divisor)), self.lighting)
        self._texture, self._seen, self._is_fine = uploaded(pixels), seen, is_same
