"""`make bench-clusters`: the picture of docs/clusters.md, as figure 1 of Mueller, Grottel and Ertl 2007: condensing argon as
spheres, as ellipsoids and as metaballs, in the colours of its clusters.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

import meniscus
from meniscus.addon.render.cluster_numbers import known_counts
from meniscus.samples import argon

from .report import ROOT

FOLDER = ROOT / "docs" / "images"
SIZE = (400, 400)
FINER = 2
"""Pictures are rendered so many times as large, and then averaged."""
FIELD = meniscus.Field("quartic", 9 / 16)
"""The paper's: the density is 1 at half the influence radius (its equation 2, which is this one by 16/9)."""
RADIUS = 1.12
"""Influence radius by the distance at which atoms rest, which is the paper's particle size doubled."""
SLAB = 0.25
"""Share of the box that is shown, or nothing but what is in front would be seen."""
SKY = np.array([0.93, 0.94, 0.95])
LOOK = meniscus.Look("studio", roughness=0.6)
COLORS = 256


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="make bench-clusters", description="Render the picture of docs/clusters.md.")
    parser.add_argument("--frame", type=int, default=argon.FRAMES, help="of the sample argon")
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="FOLDER", help="docs/images if left out")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    positions = argon.balls(frame=options.frame).positions
    slab = np.abs(positions[:, 1]) < SLAB * np.abs(positions).max()
    balls = meniscus.colored_by_cluster(meniscus.Balls(positions[slab], RADIUS * argon.SIGMA), FIELD)
    print(known_counts(balls, FIELD))
    pictures = [_picture(balls, display) for display in ("spheres", "ellipsoids", "metaballs")]
    path = options.output / "clusters.png"
    row = Image.fromarray(np.concatenate(pictures, axis=1))
    row.quantize(COLORS, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path} {path.stat().st_size / 1024:.0f} KiB", flush=True)


def _picture(balls: meniscus.Balls, display: str) -> npt.NDArray[np.uint8]:
    """(height, width, 3) sRGB, row 0 on top."""
    width, height = FINER * SIZE[0], FINER * SIZE[1]
    camera = meniscus.Camera.perspective((2.5, -10.5, 2.5), (0, 0, 0), fov_y=0.42, width=width, height=height)
    rgba = meniscus.render(balls, camera, FIELD, passes=("combined",), look=LOOK, display=display)["combined"][::-1]
    linear = (
        np.clip(rgba[..., :3] + (1 - rgba[..., 3:]) * SKY, 0, 1).reshape(SIZE[1], FINER, SIZE[0], FINER, 3).mean(axis=(1, 3))
    )
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(255 * encoded).astype(np.uint8)


if __name__ == "__main__":
    main()
