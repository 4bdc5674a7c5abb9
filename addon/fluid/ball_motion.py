"""Velocities of balls, from where they are in the frames before and after."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]
Ids = npt.NDArray[np.int32]


def matched_positions(count: int, ids: Ids | None, positions: FloatArray, other_ids: Ids | None) -> FloatArray:
    """Where the balls of one frame are in another.

    Parameters
    ----------
    count, ids
        How many there are now, and their (count,) ids; None where these are unknown.
    positions, other_ids
        (M, 3), and (M,) or None: those of the other frame.

    Returns
    -------
    (count, 3) float32: the positions of the same balls; not a number where there is none. Balls are the same where their ids
    are; where ids are not known, or do not tell balls apart, all are the same in order, if there are as many.
    """
    if ids is None or other_ids is None or np.array_equal(ids, other_ids) or not (_are_unique(ids) and _are_unique(other_ids)):
        return positions if len(positions) == count else np.full((count, 3), np.nan, np.float32)
    found = np.full((count, 3), np.nan, np.float32)
    _, here, there = np.intersect1d(ids, other_ids, assume_unique=True, return_indices=True)
    found[here] = positions[there]
    return found


def velocities_between(now: FloatArray, before: FloatArray, after: FloatArray, seconds: tuple[float, float]) -> FloatArray:
    """Velocities by central differences; one-sided ones where one side is not known, 0 where neither is.

    Parameters
    ----------
    now, before, after
        (N, 3) positions in three frames, world space; not a number where unknown.
    seconds
        From before to now, and from now to after.

    Returns
    -------
    (N, 3) float32, Blender units a second.
    """
    was, will = (np.isfinite(side).all(axis=1, keepdims=True) for side in (before, after))
    times = was * np.float32(seconds[0]) + will * np.float32(seconds[1])
    ways: FloatArray = np.where(will, after, now) - np.where(was, before, now)
    return np.divide(ways, times, out=np.zeros_like(ways), where=times != 0)


def _are_unique(ids: Ids) -> bool:
    return len(np.unique(ids)) == len(ids)
