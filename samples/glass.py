"""The dam break as clear water in a furnished scene, with traced light: shadows, reflection, refraction, absorption.

``python -m meniscus.samples.glass`` bakes the simulation (once), gives it surroundings, and lets Meniscus render all of it to
out/glass.png; ``blender --background --python`` does it in any Blender.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from . import composite
from .one_thread import bpy

PICTURE = Path(__file__).resolve().parents[1] / "out" / "glass.png"

ABSORBED, DENSITY = (0.25, 0.75, 0.85), 1.2
"""What a unit of water lets pass, and how much of it there is: red goes first."""
SKY, HORIZON, GROUND = (0.12, 0.28, 0.62), (0.85, 0.88, 0.92), (0.10, 0.09, 0.08)
"""Radiance straight up, all around and below."""


def main(arguments: list[str] | None = None) -> int:
    """Make the picture; the exit status is 0 only if it was written."""
    parser = composite.picture_parser("Render the dam break as clear water with traced light.", PICTURE, samples=32)
    return composite.make_picture(parser.parse_args(arguments), furnish, render)


def furnish(scene: bpy.types.Scene) -> None:
    """Give a scene with the dam break surroundings, a sky, and water that is clear."""
    composite.furnish(scene)
    _clear_water(scene.objects["Liquid"].data.materials[0])
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = _sky_image()
    links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])
    nodes["Background"].inputs["Strength"].default_value = 0.5  # beside the sun
    settings = scene.meniscus
    settings.render_style, settings.use_tracing = "material", True


def render(scene: bpy.types.Scene, path: Path, frame: int, samples: int) -> None:
    """Render one frame to a PNG picture; RuntimeError says why it cannot be done."""
    scene.render.engine, scene.meniscus.render_samples = "MENISCUS", samples
    scene.frame_set(frame)
    composite.save_as_png(scene, path)
    bpy.ops.render.render(write_still=True)


def _clear_water(material: bpy.types.Material) -> None:
    tree = material.node_tree
    inputs = tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    inputs["Roughness"].default_value, inputs["Transmission Weight"].default_value = 0.0, 1.0
    volume = tree.nodes.new("ShaderNodeVolumeAbsorption")
    volume.inputs["Color"].default_value, volume.inputs["Density"].default_value = (*ABSORBED, 1.0), DENSITY
    tree.links.new(volume.outputs["Volume"], tree.nodes["Material Output"].inputs["Volume"])


def _sky_image() -> bpy.types.Image:
    """An equirectangular sky that is light at the horizon."""
    height = np.linspace(-1, 1, 64, dtype=np.float32)[:, None, None]
    up = np.abs(height) ** 0.5
    sky, horizon, ground = (np.array(color, np.float32) for color in (SKY, HORIZON, GROUND))
    rows = np.where(height >= 0, (1 - up) * horizon + up * sky, ground)
    rgba = np.ones((64, 128, 4), np.float32)
    rgba[..., :3] = rows
    image = bpy.data.images.new("Sky", 128, 64, float_buffer=True)
    image.pixels.foreach_set(rgba.reshape(-1))
    return image


if __name__ == "__main__":
    raise SystemExit(main())
