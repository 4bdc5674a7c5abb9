"""Density kernels: polynomials ``f(x)`` in ``x = 1 - |p - c|^2 / R^2``, zero where ``x <= 0``, with ``f(1) = 1``.

Along a ray ``x`` is a quadratic in the distance, so ``f`` has twice the degree there. One table serves the CPU code
and, as preprocessor constants, the shaders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Kernel:
    """A polynomial density kernel.

    Attributes
    ----------
    name, label, description
        The identifier, and what the user interface shows.
    coefficients
        ``f(x) = sum_k coefficients[k] x^k``; all are >= 0, so ``f`` rises from ``f(0) = 0`` to ``f(1) = 1``.
    """

    name: str
    label: str
    description: str
    coefficients: tuple[float, ...]

    @property
    def ray_degree(self) -> int:
        """Degree of ``f`` as a polynomial in the distance along a ray."""
        return 2 * (len(self.coefficients) - 1)

    def value(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """``f(x)`` for ``x`` of any shape; zero where ``x <= 0``."""
        inside = np.maximum(x, 0)
        result: npt.NDArray[np.floating] = np.zeros_like(inside)
        for coefficient in reversed(self.coefficients):
            result = result * inside + coefficient
        return result

    def derivative(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """``f'(x)`` for ``x`` of any shape; zero where ``x <= 0``."""
        inside = np.maximum(x, 0)
        result = np.zeros_like(inside)
        for power in range(len(self.coefficients) - 1, 0, -1):
            result = result * inside + power * self.coefficients[power]
        return np.where(x > 0, result, 0)

    def inverse(self, density: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """``x`` in [0, 1] with ``f(x) = density``; NaN where density is outside [0, 1]."""
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


KERNELS: dict[str, Kernel] = {
    kernel.name: kernel
    for kernel in (
        Kernel("wyvill", "Wyvill", "Soft objects, degree six (Wyvill et al. 1986)", (0.0, 0.0, 5 / 9, 4 / 9)),
        Kernel("quartic", "Quartic", "x^2 (Murakami and Ichihara 1987)", (0.0, 0.0, 1.0)),
        Kernel("poly6", "Poly6", "x^3, the usual SPH kernel and that of Blender's metaballs", (0.0, 0.0, 0.0, 1.0)),
        Kernel("power_4", "Power 4", "x^4, the most local of the kernels", (0.0, 0.0, 0.0, 0.0, 1.0)),
        Kernel("power_1", "Power 1", "x, with creases where influence spheres begin", (0.0, 1.0)),
    )
}
