"""Polynomials in Bernstein form on [0, 1], in double precision, to judge the shader library by.

Many at a time: arrays (degree + 1, count) float64, a row a coefficient.
"""

from __future__ import annotations

from math import comb

import numpy as np
import numpy.typing as npt

from meniscus.addon.fluid.kernels import Kernel

FloatArray = npt.NDArray[np.float64]

# Segments are not split below this width. A double cannot tell the two halves of a narrower one apart safely.
_MIN_WIDTH = 2.0**-44


def product(p: FloatArray, q: FloatArray) -> FloatArray:
    """Bernstein form of p q; degrees add."""
    degree_p, degree_q = len(p) - 1, len(q) - 1
    result = np.zeros((degree_p + degree_q + 1, p.shape[1]))
    for i in range(degree_p + 1):
        for j in range(degree_q + 1):
            share = comb(degree_p, i) * comb(degree_q, j) / comb(degree_p + degree_q, i + j)
            result[i + j] += share * p[i] * q[j]
    return result


def compose(kernel: Kernel, x: FloatArray) -> FloatArray:
    """Bernstein form of ``f(x(u))`` for quadratics ``x``, (3, count): Horner's scheme with Bernstein products.

    Adding a constant to a polynomial in Bernstein form adds it to every coefficient.
    """
    leading, *rest = reversed(kernel.coefficients)
    result: FloatArray = np.full((1, x.shape[1]), leading)
    for coefficient in rest:
        result = product(result, x) + coefficient
    return result


def restrict(p: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """`p` on the segments [low, high], (count,) each, as polynomials on [0, 1] (de Casteljau twice)."""
    right = _part_from(p, low)
    # What is left of `high` in the part right of `low`; its own parameter is stretched.
    stretched = np.divide(high - low, 1 - low, out=np.zeros_like(low), where=low < 1)
    return _part_from(right[::-1], 1 - stretched)[::-1]


def _part_from(p: FloatArray, u: FloatArray) -> FloatArray:
    """The part of `p` right of `u`, as a polynomial on [0, 1]."""
    part = p.copy()
    for last in range(len(p) - 1, 0, -1):
        part[:last] += u * (part[1 : last + 1] - part[:last])
    return part


def value_and_slope(p: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``p(u)`` and ``p'(u)``, (count,) each; the degree is at least 1."""
    part = p.copy()
    for last in range(len(p) - 1, 1, -1):
        part[:last] += u * (part[1 : last + 1] - part[:last])
    rise = part[1] - part[0]
    return part[0] + u * rise, (len(p) - 1) * rise


def first_root(p: FloatArray) -> FloatArray:
    """The least u in [0, 1] with ``p(u) >= 0``, NaN where p is negative throughout; (count,).

    The control polygon bounds the polynomial. A segment whose coefficients are all negative is passed over, one with a
    single change of sign from - to + holds one root, any other is halved.
    """
    root = np.full(p.shape[1], np.nan)
    index = np.flatnonzero(p.max(axis=0) >= 0)
    low: FloatArray = np.zeros(len(index))
    width: FloatArray = np.ones(len(index))
    segment = p[:, index]
    while len(index):
        reached = segment[0] >= 0
        clear = segment.max(axis=0) < 0
        single = ~reached & (segment[-1] >= 0) & (np.count_nonzero(np.diff(segment >= 0, axis=0), axis=0) == 1)
        narrow = ~clear & ~reached & ~single & (width <= _MIN_WIDTH)
        root[index[reached | narrow]] = low[reached | narrow]
        root[index[single]] = low[single] + width[single] * _bracketed_root(segment[:, single])
        # Pass over a clear segment to the next one of the binary tree, halve an undecided one.
        low = np.where(clear, low + width, low)
        climbs = clear & (np.mod(low, 2 * width) == 0)
        width = np.where(clear, np.where(climbs, 2 * width, width), width / 2)
        going = ~(reached | narrow | single) & (low < 1)
        index, low, width = index[going], low[going], width[going]
        segment = restrict(p[:, index], low, np.minimum(low + width, 1))
    return root


def _bracketed_root(p: FloatArray) -> FloatArray:
    """The one root of each polynomial with ``p(0) < 0 <= p(1)``: Newton's method, bisection where it leaves the bracket."""
    root: FloatArray = np.full(p.shape[1], 0.5)
    index = np.arange(p.shape[1])
    low: FloatArray = np.zeros(p.shape[1])
    high: FloatArray = np.ones(p.shape[1])
    while len(index):
        u = root[index]
        height, slope = value_and_slope(p, u)
        low, high = np.where(height < 0, u, low), np.where(height < 0, high, u)
        newton = u - np.divide(height, slope, out=np.full_like(u, np.inf), where=slope > 0)
        following = np.where((newton > low) & (newton < high), newton, (low + high) / 2)
        root[index] = following
        going = np.abs(following - u) >= 1e-14
        index, p, low, high = index[going], p[:, going], low[going], high[going]
    return root
