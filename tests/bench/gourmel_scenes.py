"""The scenes of Gourmel et al. 2010, as far as the paper tells them: balls, camera, light, and what is around."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import numpy.typing as npt

import meniscus
from meniscus.addon.fluid.lighting import FluidSource, Light, Lighting, Material, WorldImage
from meniscus.addon.fluid.meshes import Meshes, MeshObject
from meniscus.addon.fluid.tracing import Tracing
from meniscus.addon.render.backdrop import backdrop
from meniscus.addon.render.surroundings import Backdrop
from meniscus.samples import scattered

FIELD = meniscus.Field("wyvill", 0.2)

SHADOWS = Tracing(reflections=0, refractions=0)
ONE_REFLECTION = replace(SHADOWS, reflections=1)
THREE_REFLECTIONS = replace(SHADOWS, reflections=3)
OCCLUSION = Tracing(reflections=0, refractions=0, shadows=False, occlusion_rays=64)

CHROME = Material((0.8, 0.82, 0.85), metallic=1.0, roughness=0.0)
PLASTIC = Material((0.75, 0.2, 0.12), roughness=0.4)
CHALK = Material((0.85, 0.82, 0.75), roughness=1.0)
WATER = Material((1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=1.33, absorption=(0.9, 0.25, 0.12))
TILES = Material((0.75, 0.72, 0.66), roughness=0.6), Material((0.16, 0.32, 0.38), roughness=0.6)

SUN = Light("SUN", (3.0, 2.9, 2.7), direction=(-0.85, 0.2, -0.5))
"""Sharp shadows, as the paper's."""


def tornado(count: int) -> meniscus.Balls:
    """A swirl that widens upwards: thin walls at its foot, a cloud at its head."""
    random = np.random.default_rng(1)
    height = random.random(count) ** 0.7
    angle = 6 * np.pi * height + random.normal(0, 0.5, count) + np.pi * random.integers(0, 2, count)
    distance = (0.1 + 0.5 * height**2) * (1 + 0.25 * random.normal(size=count))
    positions = np.stack([distance * np.cos(angle), distance * np.sin(angle), 2 * height], axis=1)
    return meniscus.Balls(positions, 2.2 * count ** (-1 / 3) * (0.2 + height))


def molecule() -> meniscus.Balls:
    """A long chain that folds back on itself, atoms of three sizes."""
    random = np.random.default_rng(2)
    steps = random.normal(size=(1360, 3))
    chain = np.zeros((1360, 3))
    for index in range(1, len(chain)):
        step = steps[index] - 0.05 * chain[index - 1]
        chain[index] = chain[index - 1] + step / np.linalg.norm(step)
    atoms = (chain[:, None] + 0.6 * random.normal(size=(1360, 4, 3))).reshape(-1, 3)
    return meniscus.Balls(atoms, random.choice([0.9, 1.1, 1.3], len(atoms)))


def pool(count: int = 10_000) -> meniscus.Balls:
    """A shallow basin of water with waves, and drops above it."""
    random = np.random.default_rng(3)
    spacing = (4 * 4 * 0.5 / count) ** (1 / 3)
    x, y, z = (axis.ravel() for axis in np.meshgrid(*(np.arange(0, edge, spacing) for edge in (4, 4, 0.5)), indexing="ij"))
    z = z * (1 + 0.3 * np.sin(3 * x) * np.cos(2.3 * y))
    water = np.stack([x, y, z], axis=1) + random.uniform(-0.2, 0.2, (len(x), 3)) * spacing
    drops = random.uniform((0, 0, 0.8), (4, 4, 1.6), (count // 50, 3))
    return meniscus.Balls(np.concatenate([water, drops]), 2 * spacing)


def sky() -> WorldImage:
    """Blue above, pale at the horizon, ground below."""
    height = np.sin((np.arange(128) + 0.5) / 128 * np.pi - np.pi / 2)[:, None]
    above = np.clip(height, 0, 1) ** 0.5
    blue = (1 - above) * np.array([0.85, 0.9, 0.95]) + above * np.array([0.12, 0.28, 0.65])
    ground = np.array([0.16, 0.14, 0.12]) * (1 + np.clip(height, -1, 0))
    rows = np.where(height > 0, blue, ground).astype(np.float32)
    return WorldImage(np.ascontiguousarray(np.broadcast_to(rows[:, None], (128, 256, 3))))


def tiled_floor(low: tuple[float, float], high: tuple[float, float], z: float, tiles: int) -> Meshes:
    """A square floor of tiles in two colours that alternate."""
    x, y = (np.linspace(low[axis], high[axis], tiles + 1) for axis in (0, 1))
    corners = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((tiles + 1, tiles + 1), z)], axis=-1).reshape(-1, 3)
    column, row = (index.ravel() for index in np.indices((tiles, tiles)))
    first = column * (tiles + 1) + row
    right, up = first + tiles + 1, first + 1
    triangles = np.stack([first, right, right + 1, first, right + 1, up], axis=1).reshape(-1, 3)
    material = np.repeat((column + row) % 2, 2)
    return Meshes(
        corners.astype(np.float32),
        triangles.astype(np.int32),
        np.broadcast_to(np.float32([0, 0, 1]), (len(triangles), 3, 3)).copy(),
        np.zeros(len(triangles), np.int32),
        material.astype(np.int32),
        (MeshObject("Floor"),),
        TILES,
    )


@dataclass(frozen=True)
class Scene:
    """A scene of the paper with its effects.

    Attributes
    ----------
    label
        As the paper calls it, and what is traced.
    balls
        Makes the fluid.
    material, tracing
        How it looks, and how far light is followed; None for light that ends at the first surface.
    lighting
        Of everything.
    floor
        Makes the meshes; None where there are none.
    direction, distance
        From the middle of the balls to the eye, and how far by their extent.
    paper
        Frames a second of the paper's BVH and of its fitted BVH.
    """

    label: str
    balls: Callable[[], meniscus.Balls]
    material: Material
    tracing: Tracing | None
    lighting: Lighting = field(default_factory=lambda: Lighting((SUN,), sky().mean, sky()))
    floor: Callable[[], Meshes] | None = None
    direction: tuple[float, float, float] = (0.48, -0.76, 0.44)
    distance: float = 1.25
    paper: tuple[float, float] = (0.0, 0.0)

    @property
    def look(self) -> meniscus.Look:
        """Its light and material."""
        source = FluidSource("Fluid", material=self.material)
        return meniscus.Look(
            style="material", color=self.material.color, sources=(source,), lighting=self.lighting, tracing=self.tracing
        )

    def camera(self, balls: meniscus.Balls, width: int, height: int) -> meniscus.Camera:
        """One that the balls fill."""
        low, high = balls.positions.min(axis=0).astype(np.float64), balls.positions.max(axis=0).astype(np.float64)
        middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
        backward = np.array(self.direction) / np.linalg.norm(self.direction)
        return meniscus.Camera.perspective(middle + self.distance * size * backward, middle, width=width, height=height)

    def surroundings(self, camera: meniscus.Camera) -> Backdrop:
        """What is behind the fluid: the floor, else the sky."""
        if self.floor is not None:
            behind = (*self.lighting.world, 1.0)
            return replace(backdrop(self.floor(), camera, self.lighting, background=behind), is_film_clear=False)
        shape = camera.height, camera.width
        colors = np.ones((*shape, 4), np.float32)
        colors[..., :3] = _seen_sky(camera, self.lighting)
        return replace(Backdrop.empty(camera), rgba=colors, color_behind=None)


def _seen_sky(camera: meniscus.Camera, lighting: Lighting) -> npt.NDArray[np.float32]:
    """(height, width, 3): the world along each pixel's ray."""
    shape = camera.height, camera.width, 3
    if lighting.image is None:
        return np.broadcast_to(np.float32(lighting.world), shape)
    _, directions = camera.view_rays()
    world = directions.reshape(-1, 3) @ camera.world_from_view[:3, :3].T
    height = np.arcsin(world[:, 2] / np.linalg.norm(world, axis=1)) / np.pi + 0.5
    rows = lighting.image.pixels[:, 0]
    return np.asarray(rows[np.clip((height * len(rows)).astype(int), 0, len(rows) - 1)].reshape(shape), np.float32)


POOL_FLOOR = partial(tiled_floor, (-2.0, -2.0), (6.0, 6.0), -0.15, 16)

SCENES = {
    "scattered_30k": Scene(
        "Scattered metaballs, ray casting", lambda: scattered.balls(30_000), PLASTIC, None, paper=(7.4, 9.4)
    ),
    "scattered_100k": Scene(
        "Scattered metaballs, ray casting", lambda: scattered.balls(100_000), PLASTIC, None, paper=(3.3, 4.3)
    ),
    "tornado_4k": Scene(
        "Tornado, hard shadows, three reflections", partial(tornado, 4_000), CHROME, THREE_REFLECTIONS, paper=(4.6, 11.0)
    ),
    "tornado_128k": Scene(
        "Tornado, hard shadows, three reflections", partial(tornado, 128_000), CHROME, THREE_REFLECTIONS, paper=(1.0, 2.4)
    ),
    "molecule_1": Scene("Molecule 1, hard shadows", molecule, PLASTIC, SHADOWS, paper=(5.8, 17.7)),
    "molecule_2": Scene(
        "Molecule 2, 64 occlusion rays", molecule, CHALK, OCCLUSION, Lighting((), (1.0, 1.0, 1.0)), paper=(0.6, 1.3)
    ),
    "pool": Scene(
        "Pool, Fresnel, refraction, three reflections, shadows",
        pool,
        WATER,
        Tracing(reflections=3, refractions=4),
        floor=POOL_FLOOR,
        direction=(0.4, -0.8, 0.45),
        distance=0.85,
        paper=(1.9, 7.1),
    ),
}
"""Table 1 and figure 8."""

EFFECTS: dict[str, Tracing | None] = {
    "ray casting": None,
    "hard shadows": SHADOWS,
    "and one reflection": ONE_REFLECTION,
    "and three": THREE_REFLECTIONS,
}
PAPER_EFFECTS = {"molecule_1": (22.3, 17.7, 12.7, 8.2), "tornado_128k": (5.7, 4.9, 3.4, 2.5)}
"""Frames a second of table 2; the paper's tornado there is smaller than the larger of table 1, and larger than the other."""
