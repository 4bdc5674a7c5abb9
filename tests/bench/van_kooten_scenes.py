"""The scenes of van Kooten, van den Bergen and Telea 2007: a cylinder of atoms, a glass of water, and a fountain."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

import meniscus

FloatArray = npt.NDArray[np.float64]

FIELD = meniscus.Field("poly6", 0.2)
"""The paper's kernel."""

CYLINDER_LENGTH, CYLINDER_SPACING = 6.0, 0.4
"""Influence radii."""

GLASS_RADIUS, WATER_HEIGHT = 1.0, 1.4
WAVE_HEIGHT, WAVE_TURNS = 0.12, 1.6
"""Of the water in the glass, Blender units; and waves across the glass."""
GLASS_SPACING, GLASS_REACH = 0.09, 2.0
"""Between balls, Blender units; and the influence radius, spacings."""

FOUNTAIN_RATE, FOUNTAIN_SPEED, FOUNTAIN_SPREAD = 900.0, 5.0, 0.45
"""Balls a second, Blender units a second, and the random part of that."""
FOUNTAIN_SECONDS = 1.1
"""How long a ball lives."""
FOUNTAIN_RADIUS, NOZZLE_RADIUS = 0.11, 0.08
GRAVITY = -9.81


def cylinder() -> meniscus.Balls:
    """Atoms in a row (figure 9)."""
    count = round(CYLINDER_LENGTH / CYLINDER_SPACING) + 1
    x = np.linspace(-CYLINDER_LENGTH / 2, CYLINDER_LENGTH / 2, count)
    return meniscus.Balls(np.column_stack([x, np.zeros((count, 2))]), 1.0)


def cylinder_start(count: int) -> npt.NDArray[np.float32]:
    """(count, 3): places around the first atom, a bad first distribution."""
    random = np.random.default_rng(9)
    directions = random.normal(size=(count, 3))
    directions[:, 0] = -np.abs(directions[:, 0])
    places = 0.6 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return np.ascontiguousarray(places - [CYLINDER_LENGTH / 2, 0, 0], np.float32)


def glass() -> meniscus.Balls:
    """Water in a round glass under a wave, and drops above it (figures 10 and 11)."""
    random = np.random.default_rng(11)
    steps = np.arange(-GLASS_RADIUS, GLASS_RADIUS + WATER_HEIGHT, GLASS_SPACING)
    x, y, z = (axis.ravel() for axis in np.meshgrid(steps, steps, steps + GLASS_RADIUS, indexing="ij"))
    surface = WATER_HEIGHT + WAVE_HEIGHT * np.sin(WAVE_TURNS * 2 * np.pi * x / (2 * GLASS_RADIUS)) * np.cos(2.0 * y)
    is_water = (np.hypot(x, y) < GLASS_RADIUS) & (z < surface)
    water = np.column_stack([x, y, z])[is_water] + random.normal(scale=0.1 * GLASS_SPACING, size=(int(is_water.sum()), 3))
    drops = random.uniform((-0.5, -0.5, WATER_HEIGHT + 0.15), (0.5, 0.5, WATER_HEIGHT + 0.6), (25, 3))
    return meniscus.Balls(np.concatenate([water, drops]), GLASS_REACH * GLASS_SPACING)


def fountain(seconds: float) -> meniscus.Balls:
    """Balls that leave a nozzle, fly, and are gone after a while; each keeps its number."""
    first = max(0, int(np.ceil((seconds - FOUNTAIN_SECONDS) * FOUNTAIN_RATE)))
    numbers = np.arange(first, int(seconds * FOUNTAIN_RATE) + 1)
    place, turn, *push = (_random(numbers, use) for use in range(5))
    across, angle = NOZZLE_RADIUS * np.sqrt(place), 2 * np.pi * turn
    start = np.column_stack([across * np.cos(angle), across * np.sin(angle), np.zeros(len(numbers))])
    speed = FOUNTAIN_SPREAD * (np.column_stack(push) - 0.5) * 2 + [0, 0, FOUNTAIN_SPEED]
    age = (seconds - numbers / FOUNTAIN_RATE)[:, None]
    fall = np.array([0.0, 0.0, GRAVITY])
    velocities = speed + age * fall
    return meniscus.Balls(start + age * speed + age**2 / 2 * fall, FOUNTAIN_RADIUS, velocities=velocities, ids=numbers)


def _random(numbers: npt.NDArray[np.int64], use: int) -> FloatArray:
    """A number from 0 to 1 for each ball, always the same for the same ball."""
    turned = np.sin((numbers + 1.0) * 12.9898 + use * 78.233) * 43758.5453
    return np.asarray(turned - np.floor(turned), np.float64)
