"""Density kernels: ``f(x)`` in ``x = 1 - |p - c|^2 / R^2``, zero where ``x <= 0``, rising from ``f(0) = 0`` to ``f(1) = 1``.

Most are polynomials: along a ray ``x`` is a quadratic in the distance, so ``f`` has twice the degree there, and roots can be
isolated. Those that are none are for methods that sample. One table serves the CPU code and, as preprocessor constants, the
shaders.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

LEAST_SHARE = 2.0**-12
"""Least s = |p - c| / R at which a kernel with a tip tells its slope by x: that grows without bound towards the centre, while
the slope by s has a limit. Nearer to the centre single precision cannot tell s from x."""


@dataclass(frozen=True)
class Kernel(ABC):
    """A density kernel.

    Attributes
    ----------
    name, label, description
        The identifier, and what the user interface shows.
    """

    name: str
    label: str
    description: str

    @abstractmethod
    def value(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """``f(x)`` for ``x`` of any shape; zero where ``x <= 0``."""

    @abstractmethod
    def derivative(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """``f'(x)`` for ``x`` of any shape; zero where ``x <= 0``."""

    @abstractmethod
    def inverse(self, density: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """``x`` in [0, 1] with ``f(x) = density``; NaN where density is outside [0, 1]."""

    @property
    @abstractmethod
    def content(self) -> float:
        """The integral of the kernel over its ball of radius 1."""

    @property
    @abstractmethod
    def steepest_slope(self) -> float:
        """The greatest ``|df/ds|``, ``s = |p - c| / R``: how fast the density of one ball of radius 1 changes at most."""

    def threshold(self, isovalue: float) -> float:
        """What the sum of the balls' densities is at the surface of this isovalue."""
        return isovalue


@dataclass(frozen=True)
class PolynomialKernel(Kernel):
    """A kernel that is a polynomial in ``x``.

    Attributes
    ----------
    coefficients
        ``f(x) = sum_k coefficients[k] x^k``; all are >= 0, so ``f`` rises from ``f(0) = 0`` to ``f(1) = 1``.
    """

    coefficients: tuple[float, ...]

    @property
    def ray_degree(self) -> int:
        """Degree of ``f`` as a polynomial in the distance along a ray."""
        return 2 * (len(self.coefficients) - 1)

    def value(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """See :meth:`Kernel.value`."""
        inside = np.maximum(x, 0)
        result: npt.NDArray[np.floating] = np.zeros_like(inside)
        for coefficient in reversed(self.coefficients):
            result = result * inside + coefficient
        return result

    def derivative(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """See :meth:`Kernel.derivative`."""
        inside = np.maximum(x, 0)
        result = np.zeros_like(inside)
        for power in range(len(self.coefficients) - 1, 0, -1):
            result = result * inside + power * self.coefficients[power]
        return np.where(x > 0, result, 0)

    def inverse(self, density: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """See :meth:`Kernel.inverse`."""
        target = np.asarray(density, np.float64)
        reachable = (target >= 0) & (target <= 1)
        # f is convex and rising on [0, 1], so Newton from x = 1 comes down to the root without passing it.
        x = np.ones_like(target)
        wanted = np.where(reachable, target, 1.0)
        for _ in range(64):
            slope = self.derivative(x)
            step = np.divide(self.value(x) - wanted, slope, out=np.zeros_like(x), where=slope > 0)
            x = np.maximum(x - step, 0.0)
            if np.max(step, initial=0.0) < 1e-15:
                break
        return np.where(reachable, x, np.nan)

    @property
    def content(self) -> float:
        """See :meth:`Kernel.content`."""
        # In spherical coordinates each power is a beta function.
        powers = (0.5 * math.gamma(1.5) * math.gamma(k + 1) / math.gamma(k + 2.5) for k in range(len(self.coefficients)))
        return 4 * math.pi * sum(c * power for c, power in zip(self.coefficients, powers, strict=True))

    @property
    def steepest_slope(self) -> float:
        """See :meth:`Kernel.steepest_slope`."""
        s = np.linspace(0, 1, 4097)
        # Sampled so finely that what lies between is within rounding of the shaders.
        return float(np.max(2 * s * self.derivative(1 - s**2 + np.finfo(float).eps)))


@dataclass(frozen=True)
class MishimaKernel(Kernel):
    """``(1 - s)^2`` with ``s = |p - c| / R``, and the surface where the root of the sum is the isovalue (Mishima, Tanaka and
    Sagawa 2008, equations 7 and 8).

    In ``x`` that is ``(1 - sqrt(1 - x))^2``: no polynomial, with a tip at the centre.
    """

    def value(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """See :meth:`Kernel.value`."""
        inside = np.clip(x, 0, 1)
        # 1 - s without cancellation.
        result: npt.NDArray[np.floating] = np.square(inside / (1 + np.sqrt(1 - inside)))
        return result

    def derivative(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """See :meth:`Kernel.derivative`: ``(1 - s) / s``, of which s is not below LEAST_SHARE."""
        inside = np.clip(x, 0, 1)
        s = np.maximum(np.sqrt(1 - inside), LEAST_SHARE)
        result: npt.NDArray[np.floating] = inside / ((1 + s) * s)
        return result

    def inverse(self, density: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """See :meth:`Kernel.inverse`."""
        target = np.asarray(density, np.float64)
        reachable = (target >= 0) & (target <= 1)
        root = np.sqrt(np.where(reachable, target, 0))
        return np.where(reachable, root * (2 - root), np.nan)

    @property
    def content(self) -> float:
        """See :meth:`Kernel.content`."""
        return 2 * math.pi / 15

    @property
    def steepest_slope(self) -> float:
        """See :meth:`Kernel.steepest_slope`."""
        return 2.0

    def threshold(self, isovalue: float) -> float:
        """See :meth:`Kernel.threshold`."""
        return isovalue * isovalue


POLYNOMIAL_KERNELS: dict[str, PolynomialKernel] = {
    kernel.name: kernel
    for kernel in (
        PolynomialKernel("wyvill", "Wyvill", "Soft objects, degree six (Wyvill et al. 1986)", (0.0, 0.0, 5 / 9, 4 / 9)),
        PolynomialKernel("quartic", "Quartic", "x^2 (Murakami and Ichihara 1987)", (0.0, 0.0, 1.0)),
        PolynomialKernel("poly6", "Poly6", "x^3, the usual SPH kernel and that of Blender's metaballs", (0.0, 0.0, 0.0, 1.0)),
        PolynomialKernel("power_4", "Power 4", "x^4, the most local of the kernels", (0.0, 0.0, 0.0, 0.0, 1.0)),
        PolynomialKernel("power_1", "Power 1", "x, with creases where influence spheres begin", (0.0, 1.0)),
    )
}
"""What every method takes."""

KERNELS: dict[str, Kernel] = {
    **POLYNOMIAL_KERNELS,
    "mishima": MishimaKernel(
        "mishima",
        "Mishima",
        "(1 - r/R)^2, and the surface where the root of the sum is T (Mishima et al. 2008). No polynomial: only methods that "
        "sample draw it, without traced light, thickness or deep images",
    ),
}
