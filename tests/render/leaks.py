"""Closed scenes: every ray of every camera must hit, and where it may do so is known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import meniscus
from meniscus.addon.fluid.kernels import KERNELS

WIDTH, HEIGHT = 1920, 1080
PROJECTIONS = ("perspective", "orthographic")

# Share of the influence radius by which a hit may lie beside its bounds; the one that every exact method keeps.
TOLERANCE = 1e-3

# World-space points, the camera's eye as origin: an array an axis.
Points = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class ClosedScene:
    """A fluid that no ray can pass by.

    Attributes
    ----------
    camera
        Makes a camera, as the random numbers will, whose every ray must hit.
    gauge
        How far points lie from the centre of a shell, or before the face of a block.
    nearest, farthest
        Between these the gauge of every hit must lie.
    """

    balls: meniscus.Balls
    camera: Callable[[np.random.Generator, str], meniscus.Camera]
    gauge: Callable[[Points, np.ndarray], np.ndarray]
    nearest: float
    farthest: float
    field: meniscus.Field = meniscus.Field()


@dataclass(frozen=True)
class Leaks:
    """How many rays were cast, how many of them missed, and how many hit what they should not see."""

    rays: int
    missed: int
    misplaced: int


def leaks(scene: ClosedScene, camera: meniscus.Camera) -> Leaks:
    """Cast an image of a closed scene."""
    image = meniscus.render(scene.balls, camera, scene.field, method="tile_caster", passes=("depth",))
    gauge = scene.gauge(_points(image["depth"].astype(np.float64), camera), camera.eye)
    is_placed = (scene.nearest <= gauge) & (gauge <= scene.farthest)
    return Leaks(image.hit.size, int((~image.hit).sum()), int((image.hit & ~is_placed).sum()))


def _points(depth: np.ndarray, camera: meniscus.Camera) -> Points:
    """Where rays have hit; each row and column of pixels has one coordinate, which spares most of the arithmetic."""
    window = camera.window
    x = window.left + (np.arange(camera.width) + 0.5) * ((window.right - window.left) / camera.width)
    y = window.bottom + (np.arange(camera.height)[:, None] + 0.5) * ((window.top - window.bottom) / camera.height)
    if camera.is_perspective:
        x, y = x * depth, y * depth
    right, up, backward = camera.world_from_view[:3, :3].T
    return tuple(right[axis] * x + up[axis] * y - backward[axis] * depth for axis in range(3))


def shell(layers: int = 1, center: tuple[float, float, float] = (0, 0, 0), size: float = 1.0) -> ClosedScene:
    """Balls all over a sphere, and over larger ones around it, seen from within the innermost."""
    layer, radius = _spread_over_sphere(4000), 0.1 * size
    shells = np.concatenate([layer * (size + number * radius) for number in range(layers)])
    balls = meniscus.Balls((shells + center).astype(np.float32), radius)
    distances = np.linalg.norm(balls.positions[: len(layer)].astype(np.float64) - center, axis=1)
    return ClosedScene(
        balls,
        lambda random, projection: _camera_inside(random, projection, np.array(center), size),
        _distance_from(center),
        # Nothing reaches farther in, and a ray that reaches the centres of the innermost layer has met the fluid.
        distances.min() - radius * (1 + TOLERANCE),
        distances.max() + radius * TOLERANCE,
    )


def inside_ball(droplets: int = 0) -> ClosedScene:
    """A ball that is seen from inside its fluid; droplets there change nothing."""
    field = meniscus.Field()
    radius = 10.0
    surface = radius * np.sqrt(1 - KERNELS[field.kernel].inverse(field.isovalue))
    random = np.random.default_rng(1)
    directions = random.normal(size=(droplets, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    positions = directions * random.uniform(0, 0.9 * surface, (droplets, 1))
    radii = np.append(np.full(droplets, 0.05 * surface), radius)
    return ClosedScene(
        meniscus.Balls(np.concatenate([positions, np.zeros((1, 3))]), radii),
        lambda random, projection: _camera_inside(random, projection, np.zeros(3), surface),
        _distance_from((0, 0, 0)),
        surface - radius * TOLERANCE,
        surface + radius * TOLERANCE,
        field,
    )


def block(center: tuple[float, float, float] = (0, 0, 0), size: float = 1.0) -> ClosedScene:
    """A cubic lattice whose upper face fills the view."""
    # On a grid that float32 has a hundred thousand units away too.
    spacing = size / 16
    axis = np.arange(-16, 17) * spacing
    lattice = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    radius = 2 * spacing
    return ClosedScene(
        meniscus.Balls((lattice + center).astype(np.float32), radius),
        lambda random, projection: _camera_above(random, projection, np.array(center), size),
        lambda points, eye: points[2] + (eye[2] - center[2]),
        size - radius * TOLERANCE,
        size + radius * (1 + TOLERANCE),
    )


def _spread_over_sphere(count: int) -> np.ndarray:
    """Points on the unit sphere, about as far from one another everywhere (a Fibonacci lattice)."""
    number = np.arange(count) + 0.5
    z = 1 - 2 * number / count
    angle = np.pi * (1 + np.sqrt(5)) * number
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], -1)


def _distance_from(center: tuple[float, float, float]) -> Callable[[Points, np.ndarray], np.ndarray]:
    def distance(points: Points, eye: np.ndarray) -> np.ndarray:
        offset = eye - center
        return np.sqrt(sum((points[axis] + offset[axis]) ** 2 for axis in range(3)))

    return distance


def _camera_inside(random: np.random.Generator, projection: str, center: np.ndarray, size: float) -> meniscus.Camera:
    """A camera whose rays all begin nearer than 0.9 sizes to the centre."""
    eye = center + random.uniform(-0.15, 0.15, 3) * size
    target = eye + random.normal(size=3)
    # With the later start no ball reaches behind the near plane and into view, so that kernel spheres hide balls.
    clips = {"clip_start": float(random.choice([1e-3, 0.3])) * size, "clip_end": 4 * size}
    if projection == "orthographic":
        scale = float(random.uniform(0.1, 0.45)) * size
        return meniscus.Camera.orthographic(eye, target, scale=scale, width=WIDTH, height=HEIGHT, **clips)
    fov_y = float(random.uniform(0.2, 1.2))
    return meniscus.Camera.perspective(eye, target, fov_y=fov_y, width=WIDTH, height=HEIGHT, **clips)


def _camera_above(random: np.random.Generator, projection: str, center: np.ndarray, size: float) -> meniscus.Camera:
    """A camera that sees nothing but the upper face: every corner of its image meets the face's plane within it."""
    while True:
        eye = center + np.append(random.uniform(-1, 1, 2), random.uniform(1.3, 3)) * size
        target = center + np.append(random.uniform(-0.6, 0.6, 2), 1) * size
        height = float(random.uniform(0.05, 1)) * size
        clips = {"clip_start": 1e-3 * size, "clip_end": 10 * size, "width": WIDTH, "height": HEIGHT}
        if projection == "orthographic":
            camera = meniscus.Camera.orthographic(eye, target, scale=height, **clips)
        else:
            fov_y = 2 * float(np.arctan(0.5 * height / np.linalg.norm(target - eye)))
            camera = meniscus.Camera.perspective(eye, target, fov_y=fov_y, **clips)
        if _is_filled(camera, center, size):
            return camera


def _is_filled(camera: meniscus.Camera, center: np.ndarray, size: float) -> bool:
    origins, directions = (rays[:: HEIGHT - 1, :: WIDTH - 1].reshape(-1, 3) for rays in camera.view_rays())
    rotation = camera.world_from_view[:3, :3].T
    origins, directions = origins @ rotation + camera.eye - center, directions @ rotation
    distance = (size - origins[:, 2]) / directions[:, 2]
    on_face = origins + distance[:, None] * directions
    return bool(np.all(distance > 0) and np.all(np.abs(on_face[:, :2]) < size))


FAR = (1e5, -1e5, 1e5)

SCENES: dict[str, Callable[[], ClosedScene]] = {
    "shell": shell,
    "shell_of_layers": lambda: shell(layers=4),
    "shell_far_from_origin": lambda: shell(layers=2, center=FAR, size=100),
    "inside_ball": inside_ball,
    "inside_ball_with_droplets": lambda: inside_ball(droplets=2000),
    "block": block,
    "block_far_from_origin": lambda: block(center=FAR, size=16),
}
