"""Writes the balls of one frame of the dam break: python -m bench.save_dam_break SPACING FRAME FRAME_END FILE.npz"""

from __future__ import annotations

import sys

import numpy as np

from meniscus.samples import dam_break, scene_parts
from meniscus.samples.one_thread import bpy


def main(spacing: float, frame: int, frame_end: int, path: str) -> None:
    scene_parts.new_scene()
    bpy.ops.wm.open_mainfile(filepath=str(dam_break.baked_file(spacing=spacing, frame_end=frame_end)))
    bpy.context.scene.frame_set(frame)
    # Imported here because it loads bpy, which one_thread has to do first.
    from meniscus.addon.blender.read_scene import read_fluid

    balls = read_fluid(bpy.context.evaluated_depsgraph_get()).balls
    np.savez(path, positions=balls.positions, radii=balls.radii, weights=balls.weights)


if __name__ == "__main__":
    main(float(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
