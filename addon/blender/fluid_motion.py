"""Velocities that the sources of a scene do not supply themselves, from the frames before and after."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from ..fluid.ball_motion import matched_positions, velocities_between
from .ball_part import BallPart, FloatArray, transformed_points
from .read_scene import FluidParts


def needs_neighbors(fluid: FluidParts) -> bool:
    """Whether the frames before and after tell more of the velocities."""
    return any(part.velocities is None or part.world_from_object is not None for part in fluid.parts)


def with_motion(
    fluid: FluidParts, before: FluidParts | None, after: FluidParts | None, seconds: tuple[float, float]
) -> FluidParts:
    """The same fluid with all velocities.

    Parts without velocities get those that the positions of the same balls say (:func:`ball_motion.matched_positions`), the
    others are carried along with their object. Parts of two frames are the same where their sources have the same name and as
    many parts.

    Parameters
    ----------
    before, after
        The fluid in the neighbouring frames; None where unknown.
    seconds
        From before to now, and from now to after.
    """
    sides = [_same_parts(fluid, other) for other in (before, after)]
    parts = tuple(_moving(part, was, will, seconds) for part, was, will in zip(fluid.parts, *sides, strict=True))
    return replace(fluid, parts=parts)


def _same_parts(fluid: FluidParts, other: FluidParts | None) -> list[BallPart | None]:
    """For each part of a fluid the one of another frame, None where there is none."""
    if other is None:
        return [None] * len(fluid.parts)
    own, others = _by_source(fluid), _by_source(other)
    same: list[BallPart | None] = []
    places: defaultdict[str, int] = defaultdict(int)
    for part in fluid.parts:
        name = fluid.sources[part.source].name
        is_same = len(others[name]) == len(own[name])
        same.append(others[name][places[name]] if is_same else None)
        places[name] += 1
    return same


def _by_source(fluid: FluidParts) -> defaultdict[str, list[BallPart]]:
    found: defaultdict[str, list[BallPart]] = defaultdict(list)
    for part in fluid.parts:
        found[fluid.sources[part.source].name].append(part)
    return found


def _moving(part: BallPart, before: BallPart | None, after: BallPart | None, seconds: tuple[float, float]) -> BallPart:
    if part.velocities is None:
        was, will = _positions_in(part, before), _positions_in(part, after)
        return replace(part, velocities=velocities_between(part.positions, was, will, seconds))
    was, will = _carried_to(part, before), _carried_to(part, after)
    if part.world_from_object is None or (was is part.positions and will is part.positions):
        return part
    return replace(part, velocities=part.velocities + velocities_between(part.positions, was, will, seconds))


def _positions_in(part: BallPart, other: BallPart | None) -> FloatArray:
    if other is None:
        return _unknown(part)
    return matched_positions(len(part), part.ids, other.positions, other.ids)


def _carried_to(part: BallPart, other: BallPart | None) -> FloatArray:
    """Where a part's balls would be in another frame if its object alone moved; in world space."""
    if other is None:
        return _unknown(part)
    here, there = part.world_from_object, other.world_from_object
    if here is None or there is None or np.array_equal(here, there) or np.linalg.det(here[:3, :3]) == 0:
        return part.positions
    return transformed_points(part.positions, there @ np.linalg.inv(here))


def _unknown(part: BallPart) -> FloatArray:
    return np.full((len(part), 3), np.nan, np.float32)
