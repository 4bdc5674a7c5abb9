"""First crossings of the isosurface from ray-ball pairs, for many rays at once, in double precision."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ...fluid.field import Field
from . import bernstein

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
Columns = TypeVar("Columns", bound="Pairs")

# Memberships of balls in intervals that are worked on at once; some 300 bytes each.
_MEMBERSHIPS_AT_ONCE = 1_000_000


@dataclass(frozen=True)
class Rays:
    """`count` rays; arrays (count, 3) and (count,). Directions are unit; the surface is looked for in [start, end]."""

    origins: FloatArray
    directions: FloatArray
    start: FloatArray
    end: FloatArray

    def __len__(self) -> int:
        return len(self.start)

    def points(self, t: FloatArray) -> FloatArray:
        """(count, 3): where each ray is at `t`."""
        return self.origins + t[:, None] * self.directions


@dataclass(frozen=True)
class Spheres:
    """Balls in the rays' space: centres (M, 3), influence radii, weights and kernel radii (M,)."""

    centers: FloatArray
    radii: FloatArray
    weights: FloatArray
    kernel_radii: FloatArray


@dataclass(frozen=True)
class Pairs:
    """Rays and the influence spheres that they cross, (P,) each, sorted by ray.

    On a ray ``x(t) = peak - ((t - middle) / R)^2``; it is positive between `entry` and `exit`.
    """

    ray: IntArray
    ball: IntArray
    peak: FloatArray
    middle: FloatArray
    entry: FloatArray
    exit: FloatArray

    def where(self: Columns, keep: npt.NDArray[np.bool_] | IntArray | slice) -> Columns:
        """The pairs that a mask, indices or a slice picks."""
        return type(self)(*(getattr(self, column.name)[keep] for column in fields(self)))


def cross(rays: Rays, spheres: Spheres, ray: IntArray, ball: IntArray) -> Pairs:
    """The crossings of candidate pairs, entries clamped to the rays' starts; candidates that do not cross are dropped."""
    order = np.argsort(ray, kind="stable")
    ray, ball = ray[order], ball[order]
    to_center = spheres.centers[ball] - rays.origins[ray]
    direction = rays.directions[ray]
    middle = np.einsum("ij,ij->i", to_center, direction)
    # |c - tc d|^2, not |c|^2 - tc^2, which cancels far from the centre.
    off_axis = to_center - middle[:, None] * direction
    radius = spheres.radii[ball]
    half_chord_2 = radius**2 - np.einsum("ij,ij->i", off_axis, off_axis)
    half_chord = np.sqrt(np.maximum(half_chord_2, 0))
    entry = np.maximum(middle - half_chord, rays.start[ray])
    pairs = Pairs(ray, ball, half_chord_2 / radius**2, middle, entry, middle + half_chord)
    return pairs.where((half_chord_2 > 0) & (pairs.exit > entry) & (entry < rays.end[ray]))


def first_crossings(rays: Rays, spheres: Spheres, pairs: Pairs, field: Field) -> FloatArray:
    """Distance along each ray to where it first crosses the isosurface, either way; infinite where it does not; (count,)."""
    inside = density(rays, spheres, pairs, rays.start, field) >= field.isovalue
    pairs = _before_kernel_spheres(rays, spheres, pairs, inside)
    first = np.full(len(rays), np.inf)
    for part in _parts(pairs, len(rays)):
        interval_ray, distance = _crossings(spheres, part, inside, field)
        np.minimum.at(first, interval_ray, distance)
    return np.where(first <= rays.end, first, np.inf)


def _parts(pairs: Pairs, ray_count: int) -> Iterator[Pairs]:
    """The pairs in whole rays, few enough at a time: n balls on a ray have up to n^2 memberships in intervals."""
    per_ray = np.bincount(pairs.ray, minlength=ray_count)
    part_of_ray = np.cumsum(per_ray**2) // _MEMBERSHIPS_AT_ONCE
    edges = np.flatnonzero(np.diff(part_of_ray[pairs.ray])) + 1
    for begin, end in zip([0, *edges], [*edges, len(pairs.ray)], strict=True):
        yield pairs.where(slice(begin, end))


def _crossings(spheres: Spheres, pairs: Pairs, inside: npt.NDArray[np.bool_], field: Field) -> tuple[IntArray, FloatArray]:
    """The first crossing in each interval: its ray and its distance, infinite where there is none; (I,) each."""
    interval_ray, begin, end, member_of, member = _intervals(pairs)
    densities = _densities(pairs.where(member), spheres, begin[member_of], end[member_of], field)
    totals = np.stack([_sums(member_of, coefficient, len(begin)) for coefficient in densities])
    # Seen from outside the density rises to the isovalue, seen from inside it falls to it.
    sign = np.where(inside[interval_ray], -1.0, 1.0)
    root = bernstein.first_root(sign * (totals - field.isovalue))
    # Between crossings that coincide only some of their balls are counted: there is no interval.
    missed = np.isnan(root) | (end <= begin)
    return interval_ray, np.where(missed, np.inf, begin + root * (end - begin))


def _sums(group: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Sums of `values` by group, (count,)."""
    # bincount of nothing gives integers.
    return np.bincount(group, values, count).astype(np.float64, copy=False)


def density(rays: Rays, spheres: Spheres, pairs: Pairs, t: FloatArray, field: Field) -> FloatArray:
    """The field at the distance `t` along each ray, (count,)."""
    return _sums(pairs.ray, _shares(spheres, pairs, t, field), len(rays))


def _shares(spheres: Spheres, pairs: Pairs, t: FloatArray, field: Field) -> FloatArray:
    """(P,): ``q f(x)`` of each pair where its ray is at `t`."""
    finite = np.where(np.isfinite(t), t, 0)
    x = pairs.peak - ((finite[pairs.ray] - pairs.middle) / spheres.radii[pairs.ball]) ** 2
    return spheres.weights[pairs.ball] * field.density_kernel.value(x)


def _before_kernel_spheres(rays: Rays, spheres: Spheres, pairs: Pairs, inside: npt.NDArray[np.bool_]) -> Pairs:
    """Drop what lies behind the front of a kernel sphere: the surface is not behind it (Kanamori et al. 2008, 5.2).

    True only if no weight is negative and the ray starts outside the fluid.
    """
    if np.any(spheres.weights < 0):
        return pairs
    radius, kernel_radius = spheres.radii[pairs.ball], spheres.kernel_radii[pairs.ball]
    half_chord_2 = kernel_radius**2 - (1 - pairs.peak) * radius**2
    front = pairs.middle - np.sqrt(np.maximum(half_chord_2, 0))
    # A kernel sphere behind the ray's start, whose influence sphere it is still in, hides nothing.
    front = np.where((half_chord_2 > 0) & (front >= rays.start[pairs.ray]), front, np.inf)
    nearest = np.full(len(rays), np.inf)
    np.minimum.at(nearest, pairs.ray, front)
    # Keep the neighbourhood of the front itself, where the root may be.
    limit = np.where(inside, np.inf, nearest + 1e-9 * np.abs(nearest))
    return pairs.where(pairs.entry <= limit[pairs.ray])


def _intervals(pairs: Pairs) -> tuple[IntArray, FloatArray, FloatArray, IntArray, IntArray]:
    """Cut the rays at all crossings.

    Returns
    -------
    ray, begin, end : (I,) the intervals between consecutive crossings of one ray
    interval, pair : (C,) which pairs cover which intervals
    """
    count = len(pairs.ray)
    ray = np.concatenate([pairs.ray, pairs.ray])
    t = np.concatenate([pairs.entry, pairs.exit])
    order = np.lexsort((t, ray))
    rank = np.empty(2 * count, np.intp)
    rank[order] = np.arange(2 * count)
    ray, t = ray[order], t[order]
    # Interval k runs from crossing k to k + 1. One that would join two rays is empty.
    covered = rank[count:] - rank[:count]
    pair = np.repeat(np.arange(count), covered)
    offset = np.arange(len(pair)) - np.repeat(np.cumsum(covered) - covered, covered)
    interval = rank[:count][pair] + offset
    return ray[:-1], t[:-1], np.where(ray[1:] == ray[:-1], t[1:], t[:-1]), interval, pair


def _densities(members: Pairs, spheres: Spheres, begin: FloatArray, end: FloatArray, field: Field) -> FloatArray:
    """Bernstein form of ``q f(x)`` of each member over its interval, (degree + 1, C)."""
    radius = spheres.radii[members.ball]
    at_begin, at_end = (begin - members.middle) / radius, (end - members.middle) / radius
    x = np.stack([members.peak - at_begin**2, members.peak - at_begin * at_end, members.peak - at_end**2])
    return spheres.weights[members.ball] * bernstein.compose(field.density_kernel, x)


def _reach(pairs: Pairs, t: FloatArray) -> npt.NDArray[np.bool_]:
    """(P,): whether the pair's ball reaches its ray's point at `t`."""
    at = t[pairs.ray]
    return (pairs.entry <= at) & (at <= pairs.exit)


def normals(rays: Rays, spheres: Spheres, pairs: Pairs, t: FloatArray, field: Field) -> FloatArray:
    """(count, 3): unit, against the gradient of the field at `t`; 0 where `t` is infinite."""
    pairs = pairs.where(_reach(pairs, t))
    from_center = rays.points(np.where(np.isfinite(t), t, 0))[pairs.ray] - spheres.centers[pairs.ball]
    radius = spheres.radii[pairs.ball]
    x = 1 - np.einsum("ij,ij->i", from_center, from_center) / radius**2
    pull = spheres.weights[pairs.ball] * field.density_kernel.derivative(x) / radius**2
    outward = np.stack([_sums(pairs.ray, pull * axis, len(rays)) for axis in from_center.T], axis=1)
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    unit: FloatArray = np.divide(outward, length, out=np.zeros_like(outward), where=length > 0)
    return unit


def blended_colors(
    rays: Rays, spheres: Spheres, pairs: Pairs, t: FloatArray, field: Field, colors: npt.NDArray[np.floating]
) -> FloatArray:
    """(count, 3): the balls' colours weighted by their share of the density at `t`; 0 where `t` is infinite."""
    pairs = pairs.where(_reach(pairs, t))
    share = np.maximum(_shares(spheres, pairs, t, field), 0)
    total = _sums(pairs.ray, share, len(rays))
    summed = np.stack([_sums(pairs.ray, share * channel[pairs.ball], len(rays)) for channel in colors.T], axis=1)
    return np.divide(summed, total[:, None], out=np.zeros_like(summed), where=total[:, None] > 0)
