"""The dam break in a scene of Cycles, composited headless to one picture.

``python -m meniscus.samples.composite`` bakes the simulation (once), gives it surroundings that Cycles renders, lets Meniscus
render the fluid, and writes out/composite.png; ``blender --background --python`` does it in any Blender.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from ..addon.fluid.errors import MeniscusError
from . import dam_break, scene_parts
from .one_thread import bpy

PICTURE = Path(__file__).resolve().parents[1] / "out" / "composite.png"
FRAME = 26
"""When the wave has hit the pillar."""

WATER, WOOD, STONE, PAINT = (0.02, 0.25, 0.55), (0.35, 0.15, 0.05), (0.16, 0.16, 0.17), (0.80, 0.16, 0.02)


def main(arguments: list[str] | None = None) -> int:
    """Make the picture; the exit status is 0 only if it was written."""
    parser = picture_parser("Composite the dam break over a scene that Cycles renders.", PICTURE, samples=64)
    return make_picture(parser.parse_args(arguments), furnish, render)


def picture_parser(description: str, picture: Path, samples: int) -> argparse.ArgumentParser:
    """The options of a picture of the dam break."""
    parser = argparse.ArgumentParser(description=description)
    place = f"out/{picture.name} beside the code if left out"
    parser.add_argument("--output", default=str(picture), metavar="FILE", help=place)
    parser.add_argument("--frame", type=int, default=FRAME, help=f"{FRAME} if left out")
    parser.add_argument("--samples", type=int, default=samples, help=f"of each pixel, {samples} if left out")
    return parser


def make_picture(
    options: argparse.Namespace,
    furnish: Callable[[bpy.types.Scene], None],
    render: Callable[[bpy.types.Scene, Path, int, int], None],
) -> int:
    """Bake the dam break where it was not before, furnish its scene and render it; the exit status."""
    try:
        scene_parts.new_scene()
        bpy.ops.wm.open_mainfile(filepath=str(dam_break.baked_file()))
        furnish(bpy.context.scene)
        render(bpy.context.scene, Path(options.output).absolute(), options.frame, options.samples)
    except (MeniscusError, RuntimeError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"Wrote {options.output}")
    return 0


def furnish(scene: bpy.types.Scene) -> None:
    """Give a scene with the dam break a floor, things that stand in the water and around it, light and materials."""
    for item in scene.objects:
        if item.name.startswith("Tank"):
            item.hide_render = True
    floor = scene_parts.add_box(scene, "Floor", (-40.0, -20.0, -0.2), (60.0, 60.0, -0.001))
    _paint(floor, STONE, roughness=0.6)
    _paint(scene.objects["Pillar"], WOOD, roughness=0.5)
    for number, (low, high) in enumerate(
        (((0.35, -0.75, 0.0), (0.75, -0.35, 0.4)), ((2.9, 0.55, 0.0), (3.25, 0.9, 1.3)), ((1.0, 0.3, 0.0), (1.25, 0.55, 0.9)))
    ):
        _paint(scene_parts.add_box(scene, f"Block {number + 1}", low, high), PAINT if number else WOOD, roughness=0.4)
    _paint(scene.objects["Liquid"], WATER, roughness=0.12, transmission=0.35)
    sun = scene.objects["Sun"]
    sun.data.energy, sun.data.angle, sun.rotation_euler = 6.0, 0.05, (0.75, 0.25, -0.5)
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.10, 0.14, 0.22, 1.0)


def render(scene: bpy.types.Scene, path: Path, frame: int, samples: int) -> None:
    """Composite one frame to a PNG picture; RuntimeError says why it cannot be done."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", samples
    scene.cycles.use_denoising = False  # not every build of Blender can
    scene.frame_set(frame)
    bpy.ops.meniscus.add_compositing()
    save_as_png(scene, path)
    bpy.ops.render.render(write_still=True)


def save_as_png(scene: bpy.types.Scene, path: Path) -> None:
    """Let renders of a scene be saved as a PNG picture."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since 5.0
        settings.media_type = "IMAGE"
    settings.file_format = "PNG"
    scene.render.filepath = str(path)


def _paint(item: bpy.types.Object, color: scene_parts.Point, roughness: float, transmission: float = 0.0) -> None:
    material = bpy.data.materials.new(item.name)
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*color, 1.0)
    inputs["Roughness"].default_value, inputs["Transmission Weight"].default_value = roughness, transmission
    inputs["IOR"].default_value = 1.33
    item.data.materials.clear()
    item.data.materials.append(material)


if __name__ == "__main__":
    raise SystemExit(main())
