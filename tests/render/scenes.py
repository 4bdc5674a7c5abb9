"""Analytic scenes that every method must get right: small, and each named by what is hard about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import meniscus

WIDTH, HEIGHT = 96, 72


@dataclass(frozen=True)
class Scene:
    """Balls, their field, and where they are looked at from.

    Attributes
    ----------
    eye, target
        World space.
    view_height
        Height of the view at the target, Blender units.
    """

    balls: meniscus.Balls
    eye: tuple[float, float, float] = (0.0, -4.0, 0.0)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    view_height: float = 3.0
    field: meniscus.Field = meniscus.Field()
    clip_start: float = 0.01
    clip_end: float = 1e5

    def camera(self, projection: str) -> meniscus.Camera:
        """A "perspective" or "orthographic" camera."""
        clips = {"clip_start": self.clip_start, "clip_end": self.clip_end}
        size = {"width": WIDTH, "height": HEIGHT}
        if projection == "orthographic":
            return meniscus.Camera.orthographic(self.eye, self.target, scale=self.view_height, **size, **clips)
        distance = float(np.linalg.norm(np.subtract(self.target, self.eye)))
        fov_y = 2 * np.arctan(0.5 * self.view_height / distance)
        return meniscus.Camera.perspective(self.eye, self.target, fov_y=fov_y, **size, **clips)


def _random_positions(count: int, seed: int, size: float = 1.0) -> np.ndarray:
    return (np.random.default_rng(seed).random((count, 3)) - 0.5) * size


def one_ball() -> Scene:
    return Scene(meniscus.Balls([[0, 0, 0]], 1.2))


def two_balls() -> Scene:
    return Scene(meniscus.Balls([[-0.5, 0, 0], [0.5, 0.1, 0.1]], 1.0))


def three_balls() -> Scene:
    return Scene(meniscus.Balls([[-0.5, 0, 0], [0.5, 0, 0], [0, 0.3, 0.6]], [1.0, 0.9, 0.6]))


def ten_balls() -> Scene:
    return Scene(meniscus.Balls(_random_positions(10, 1, 2), np.linspace(0.5, 1.1, 10)))


def coincident_balls() -> Scene:
    """Four balls in one place: all their crossings coincide; another crosses them."""
    return Scene(meniscus.Balls([[0, 0, 0]] * 4 + [[0.7, 0, 0]], 0.9, weights=[0.3, 0.3, 0.3, 0.3, 1]))


def tangent_rays() -> Scene:
    """Seen straight on, whole pixel columns are tangent to influence spheres that a third ball overlaps."""
    pixel = 3.0 / HEIGHT
    # The pixel centre 0.5 right of the middle is the tangent of spheres of radius 0.5 about 0.5 farther.
    edge = 0.5 * pixel + 0.5
    return Scene(meniscus.Balls([[edge, 0, 0], [edge, 1, 0], [0, 0.2, 0]], [0.5, 0.5, 1.0]))


def ball_behind_ball() -> Scene:
    return Scene(meniscus.Balls([[0, 0, 0], [0.1, 3, 0.1], [-0.6, 1.2, 0]], [0.8, 1.5, 1.0]))


def eye_inside_influence_sphere() -> Scene:
    return Scene(meniscus.Balls([[0, 0, 0], [0.9, 1.8, 0.3], [0, -0.5, -0.4]], [1.4, 1.2, 0.6]), eye=(0.0, -1.0, 0.1))


def eye_behind_kernel_sphere() -> Scene:
    """The eye has left a ball, is still in its influence sphere, and looks at others."""
    return Scene(
        meniscus.Balls([[0, -1.5, 0], [0.3, 1, 0], [-0.5, 1.6, 0.2]], [1.4, 0.9, 0.8]), eye=(0.0, -0.4, 0.0), view_height=0.8
    )


def eye_inside_fluid() -> Scene:
    """The surface is seen from within."""
    return Scene(meniscus.Balls(_random_positions(60, 2, 2), 0.9), eye=(0.05, -0.3, 0.0), view_height=1.0)


def near_clip_cuts_fluid() -> Scene:
    return Scene(meniscus.Balls([[-0.4, 0, 0], [0.4, 0.2, 0.1]], 1.2), clip_start=3.8, clip_end=4.6)


def far_from_origin() -> Scene:
    """A hundred thousand units away, where a float has steps of 1/128."""
    shift = np.array([1e5, -1e5, 1e5])
    balls = np.round(_random_positions(10, 3, 2) * 128) / 128
    eye, target = tuple(shift + (0.003, -4, 0.001)), tuple(shift)
    return Scene(meniscus.Balls((shift + balls).astype(np.float32), 0.8), eye, target)


def radii_over_six_orders() -> Scene:
    """Pairs of balls from a thousandth to a thousand units, each as large in the view as the others."""
    radii = 10.0 ** np.arange(-3, 4)
    across = np.array(
        [[x, 0, z] for x, z in ((-1.1, 0), (-0.6, 0.8), (-0.2, -0.6), (0.2, 0.7), (0.5, -0.4), (0.9, 0.6), (1.3, -0.7))]
    )
    first = radii[:, None] * (across * 1.6 + [0, 7, 0])
    second = first + radii[:, None] * [0.5, 0.2, 0.3]
    balls = meniscus.Balls(np.concatenate([first, second]), np.tile(radii, 2))
    return Scene(balls, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), view_height=0.7, clip_start=1e-4)


def random_5000() -> Scene:
    return Scene(meniscus.Balls(_random_positions(5000, 4, 2), np.linspace(0.05, 0.18, 5000)))


def lattice_with_droplets() -> Scene:
    """A dense block, two spacings of reach: dozens of balls overlap everywhere."""
    axis = np.arange(12) * 0.12 - 0.66
    lattice = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    lattice += _random_positions(len(lattice), 5, 0.05)
    return Scene(meniscus.Balls(np.concatenate([lattice, _random_positions(60, 6, 2.6)]), 0.24))


def long_lists() -> Scene:
    """Fifty balls over one another, each too thin to be seen until many have been crossed."""
    return Scene(meniscus.Balls(_random_positions(50, 7, 0.8), 0.9, weights=0.06))


def crowded_corner() -> Scene:
    """A few balls, and in a corner so many over one another that lists overflow there and nowhere else."""
    corner = _random_positions(40, 10, 0.2) + [1.2, 0, 0.9]
    radii, weights = np.repeat([0.9, 0.5], [10, 40]), np.repeat([1, 0.06], [10, 40])
    return Scene(meniscus.Balls(np.concatenate([_random_positions(10, 1, 2), corner]), radii, weights))


def negative_weights() -> Scene:
    """A ball carves into others; kernel spheres no longer bound the surface."""
    return Scene(meniscus.Balls([[-0.3, 0, 0], [0.4, 0.2, 0], [0.1, -0.5, 0.2]], [1.0, 1.0, 0.8], weights=[1, 1, -0.9]))


def _with_kernel(kernel: str) -> Callable[[], Scene]:
    return lambda: replace(ten_balls(), field=meniscus.Field(kernel, 0.25))


SCENES: dict[str, Callable[[], Scene]] = {
    make.__name__: make
    for make in (
        one_ball,
        two_balls,
        three_balls,
        ten_balls,
        coincident_balls,
        tangent_rays,
        ball_behind_ball,
        eye_inside_influence_sphere,
        eye_behind_kernel_sphere,
        eye_inside_fluid,
        near_clip_cuts_fluid,
        far_from_origin,
        radii_over_six_orders,
        random_5000,
        lattice_with_droplets,
        long_lists,
        crowded_corner,
        negative_weights,
    )
} | {f"kernel_{name}": _with_kernel(name) for name in ("quartic", "poly6", "power_4", "power_1")}
