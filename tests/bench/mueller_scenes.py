"""The data sets of Mueller, Grottel and Ertl 2007, as far as the paper tells them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

import meniscus
from meniscus.samples import argon, ethane, molecule

FIELD = meniscus.Field("quartic", 9 / 16)
"""The paper's density 16/9 x^2 with the threshold 1: a lone ball looks like a sphere of half its influence radius."""
EYE_DIRECTION = (0.48, -0.76, 0.44)


@dataclass(frozen=True)
class Paper:
    """What the paper says of a data set.

    Attributes
    ----------
    milliseconds
        Of building its vicinity texture (table 1).
    frames
        A second, by our name of the method: vicinity (table 1), walking_depth_plane (table 3, 100 iterations).
    groups
        Spheres with and without neighbours, and the least, the mean and the greatest number of neighbours of those that have
        any (table 2).
    """

    milliseconds: str
    frames: dict[str, float]
    groups: tuple[int, int, int, float, int]


@dataclass(frozen=True)
class DataSet:
    """A data set: ours, and the paper's."""

    label: str
    balls: Callable[[], meniscus.Balls]
    paper: Paper

    def camera(self, balls: meniscus.Balls, size: int) -> meniscus.Camera:
        """All of the balls in a square image."""
        low, high = balls.bounds
        middle, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        eye = middle + np.array(EYE_DIRECTION) / np.linalg.norm(EYE_DIRECTION) * 2.6 * reach
        return meniscus.Camera.perspective(
            tuple(eye), tuple(middle), fov_y=2 * np.arcsin(0.85 / 2.6), width=size, height=size, clip_start=0.01 * reach
        )


def random_set(count: int, neighbours: float, seed: int) -> meniscus.Balls:
    """Balls at random places in a cube, which have so many neighbours on average; no two overlap by more than half."""
    side = float((count * 4 / 3 * np.pi * 2**3 / neighbours) ** (1 / 3))
    random = np.random.default_rng(seed)
    positions = np.empty((0, 3))
    while len(positions) < count:
        place = random.random(3) * side
        if np.all(np.sum((positions - place) ** 2, axis=1) > 0.5**2):
            positions = np.vstack([positions, place])
    return meniscus.Balls(positions, 1.0)


DATA_SETS: dict[str, DataSet] = {
    "argon": DataSet(
        "Argon", argon.balls, Paper("113", {"vicinity": 0.1, "walking_depth_plane": 13}, (3684, 1316, 1, 39.3, 125))
    ),
    "ethane": DataSet(
        "Ethane", ethane.balls, Paper("2568", {"vicinity": 0.2, "walking_depth_plane": 5}, (24838, 162, 1, 85.2, 178))
    ),
    "sim_1": DataSet(
        "Sim-1",
        partial(random_set, 100, 0.7, 1),
        Paper("< 1", {"vicinity": 61, "walking_depth_plane": 61}, (40, 60, 1, 1.7, 4)),
    ),
    "sim_2": DataSet(
        "Sim-2", partial(random_set, 500, 1.1, 2), Paper("1", {"vicinity": 4, "walking_depth_plane": 15}, (305, 195, 1, 1.6, 7))
    ),
    "sim_3": DataSet(
        "Sim-3",
        partial(random_set, 100, 13.0, 3),
        Paper("< 1", {"vicinity": 4, "walking_depth_plane": 15}, (99, 1, 2, 8.0, 17)),
    ),
    "protein": DataSet(
        "1A2J; ours a protein",
        molecule.balls,
        Paper("12", {"vicinity": 0.14, "walking_depth_plane": 21}, (1454, 0, 2, 6.9, 13)),
    ),
}
