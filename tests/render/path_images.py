"""Renders all scenes on the SIMD path that MENISCUS_SIMD names: python path_images.py IMAGES.npz"""

from __future__ import annotations

import sys

import numpy as np
from scenes import SCENES

import meniscus

PROJECTIONS = ("perspective", "orthographic")


def main(output: str) -> None:
    images: dict[str, np.ndarray] = {}
    for name, make in SCENES.items():
        scene = make()
        for projection in PROJECTIONS:
            image = meniscus.render(scene.balls, scene.camera(projection), scene.field, method="tile_caster")
            images |= {f"{name} {projection} {part}": image[part] for part in ("depth", "normal")}
            images[f"{name} {projection} hit"] = image.hit
    np.savez(output, path=image.info.device.split()[-1], **images)


if __name__ == "__main__":
    main(sys.argv[1])
