"""Draws figure 2 of Kanamori, Szego and Nishita 2008: what a ray crosses, as Meniscus computes it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

import meniscus

FloatArray = npt.NDArray[np.float64]

SIZE = (640, 480)
FINER = 4
"""The drawing is made so many times as large, and then made smaller, which smooths its lines."""
CENTRE, WIDTH = (0.05, 0.25), 6.2
"""Of what is shown of the plane y = 0: the middle (x, z) and the width, Blender units."""
START = -2.5
"""Where on the x axis the ray starts; it goes along x."""
PAPER, FLUID, RIM, SPHERE, INK, HIT = "#ffffff", "#c3daf0", "#2f6cb0", "#7a7a7a", "#101010", "#c8261e"


def draw(balls: meniscus.Balls, field: meniscus.Field) -> Image.Image:
    """Influence spheres, surface and ray in the plane y = 0, in which all centres lie."""
    plane = _Plane()
    plane.fill(_inside(balls, field, *plane.points()))
    for number, (centre, radius) in enumerate(zip(balls.positions.astype(float), balls.radii.astype(float), strict=True)):
        plane.circle(centre[0], centre[2], radius)
        plane.label(centre[0], centre[2], "B", number)
    plane.ray(START, CENTRE[0] + 0.42 * WIDTH)
    plane.label(START - 0.15, 0.0, "R", 1)
    for number, t in enumerate(crossings(balls)):
        plane.dot(START + t, INK)
        plane.label(START + t + 0.02, 0.17 if number % 2 else -0.17, "t", number)
    plane.dot(START + first_hit(balls, field), HIT)
    return plane.finished()


def crossings(balls: meniscus.Balls) -> FloatArray:
    """The parameters of the ray, in order, where it enters or leaves influence spheres."""
    middle = balls.positions[:, 0].astype(np.float64) - START
    half_chord_2 = balls.radii.astype(np.float64) ** 2 - balls.positions[:, 2].astype(np.float64) ** 2
    met = half_chord_2 > 0
    half_chord = np.sqrt(half_chord_2[met])
    return np.sort(np.concatenate([middle[met] - half_chord, middle[met] + half_chord]))


def first_hit(balls: meniscus.Balls, field: meniscus.Field) -> float:
    """The parameter at which the ray meets the surface."""
    t, _ = meniscus.oracle.cast(balls, field, np.array([[START, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]]))
    return float(t[0])


def _inside(balls: meniscus.Balls, field: meniscus.Field, x: FloatArray, z: FloatArray) -> npt.NDArray[np.bool_]:
    """Where in the plane the density exceeds the isovalue."""
    centres, radii = balls.positions.astype(np.float64), balls.radii.astype(np.float64)
    distance_2 = (x[..., None] - centres[:, 0]) ** 2 + (z[..., None] - centres[:, 2]) ** 2
    density = (balls.weights * field.density_kernel.value(1 - distance_2 / radii**2)).sum(axis=-1)
    is_inside: npt.NDArray[np.bool_] = density > field.isovalue
    return is_inside


class _Plane:
    """The plane y = 0, drawn with x to the right and z upwards."""

    def __init__(self) -> None:
        self._image = Image.new("RGB", (SIZE[0] * FINER, SIZE[1] * FINER), PAPER)
        self._draw = ImageDraw.Draw(self._image)
        self._scale = SIZE[0] * FINER / WIDTH

    def points(self) -> tuple[FloatArray, FloatArray]:
        """x and z of every pixel, the top row first."""
        row, column = np.mgrid[: self._image.height, : self._image.width] + 0.5
        return (
            (column - self._image.width / 2) / self._scale + CENTRE[0],
            (self._image.height / 2 - row) / self._scale + CENTRE[1],
        )

    def fill(self, is_inside: npt.NDArray[np.bool_]) -> None:
        """Fill a region, and draw its rim."""
        reach = 2 * FINER // 2
        near = np.stack([np.roll(is_inside, (i, j), (0, 1)) for i in (-reach, 0, reach) for j in (-reach, 0, reach)])
        self._image.paste(RIM, mask=Image.fromarray(near.any(axis=0)))
        self._image.paste(FLUID, mask=Image.fromarray(near.all(axis=0)))

    def circle(self, x: float, z: float, radius: float) -> None:
        (left, top), (right, bottom) = self._pixel(x - radius, z + radius), self._pixel(x + radius, z - radius)
        self._draw.ellipse((left, top, right, bottom), outline=SPHERE, width=round(1.3 * FINER))

    def ray(self, begin: float, end: float) -> None:
        """An arrow along the x axis."""
        self._draw.line((*self._pixel(begin, 0), *self._pixel(end, 0)), fill=INK, width=round(1.6 * FINER))
        x, y = self._pixel(end, 0)
        size = 7 * FINER
        self._draw.polygon([(x + size, y), (x - size, y - size * 0.5), (x - size, y + size * 0.5)], fill=INK)

    def dot(self, x: float, color: str) -> None:
        """A point of the x axis."""
        (column, row), size = self._pixel(x, 0), 3.6 * FINER
        self._draw.ellipse((column - size, row - size, column + size, row + size), fill=color)

    def label(self, x: float, z: float, letter: str, number: int) -> None:
        """A letter with an index, its middle at (x, z)."""
        large, small = (ImageFont.load_default(size * FINER) for size in (19, 13))
        column, row = self._pixel(x, z)
        self._draw.text((column, row), letter, fill=INK, font=large, anchor="rm")
        self._draw.text((column + FINER, row + 5 * FINER), str(number), fill=INK, font=small, anchor="lm")

    def finished(self) -> Image.Image:
        """The drawing at its size."""
        return self._image.resize(SIZE, Image.Resampling.LANCZOS)

    def _pixel(self, x: float, z: float) -> tuple[float, float]:
        return (
            (x - CENTRE[0]) * self._scale + self._image.width / 2,
            self._image.height / 2 - (z - CENTRE[1]) * self._scale,
        )
