"""A camera in the scene coordinates of a tree, as lib/tree_camera.glsl wants it."""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt

from ..addon.fluid.camera import Camera
from ..addon.fluid.field import Field
from ..addon.render.fitted_bvh import TreeArrays
from .camera_parts import camera_uniforms


def tree_camera_uniforms(tree: TreeArrays, camera: Camera, field: Field) -> dict[str, object]:
    """A camera that begins at a plane near the tree, and the field: what is large is subtracted here, in double precision."""
    forward = -camera.world_from_view[:3, 2]
    depth = _first_depth(tree, camera, forward)
    anchor = camera.eye + depth * forward - tree.origin
    return {
        **camera_uniforms(camera),
        "isovalue": field.threshold,
        "anchor": tuple(anchor.tolist()),
        "anchor_depth": depth,
        "clip_depths": (camera.clip_start - depth, camera.clip_end - depth),
    }


def _first_depth(tree: TreeArrays, camera: Camera, forward: npt.NDArray[np.float64]) -> float:
    """The planar depth at which the tree begins, between the clip distances."""
    if not len(tree.nodes) or not np.all(np.isfinite(tree.nodes[0, :3])):
        return camera.clip_start
    sides = tree.nodes[0, [[0, 1, 2], [4, 5, 6]]].astype(np.float64)
    corners = np.array([[sides[side, axis] for axis, side in enumerate(corner)] for corner in product((0, 1), repeat=3)])
    nearest = float(np.min((corners + tree.origin - camera.eye) @ forward))
    return min(max(nearest, camera.clip_start), camera.clip_end)
