"""A camera in the scene coordinates of a tree, as lib/tree_camera.glsl wants it."""

from __future__ import annotations

import numpy as np

from ..addon.fluid.camera import Camera
from ..addon.fluid.field import Field
from ..addon.render.fitted_bvh import TreeArrays
from .scene_camera import scene_camera_uniforms


def tree_camera_uniforms(tree: TreeArrays, camera: Camera, field: Field) -> dict[str, object]:
    """A camera that begins at a plane near the tree, and the field."""
    box = tree.nodes[0, [[0, 1, 2], [4, 5, 6]]] if len(tree.nodes) else np.full((2, 3), np.inf)
    return {**scene_camera_uniforms(box, tree.origin, camera), "isovalue": field.threshold}
