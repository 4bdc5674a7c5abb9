"""The density field whose isosurface is the fluid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .density_profile import DensityProfile
from .errors import InputError
from .kernels import KERNELS, Kernel, PolynomialKernel


@dataclass(frozen=True)
class Field:
    """The surface is where ``sum_i q_i f(x_i) = threshold``; that is the isovalue, of the kernel "mishima" its square.

    Parameters
    ----------
    kernel
        Name of a density kernel, see :data:`kernels.KERNELS`; or a kernel of one's own.
    isovalue
        The threshold T, greater than 0. A lone ball of weight 1 is visible for T < 1.

    Raises
    ------
    InputError
        The kernel is unknown or the isovalue is not a positive finite number.
    """

    kernel: str | DensityProfile = "wyvill"
    isovalue: float = 0.2

    def __post_init__(self) -> None:
        if not isinstance(self.kernel, DensityProfile) and self.kernel not in KERNELS:
            raise InputError(f"Unknown kernel '{self.kernel}': choose one of {', '.join(KERNELS)}")
        if not (math.isfinite(self.isovalue) and self.isovalue > 0):
            raise InputError(f"The isovalue must be a positive number, not {self.isovalue}")

    @property
    def density_kernel(self) -> Kernel:
        """The kernel itself."""
        return self.kernel if isinstance(self.kernel, DensityProfile) else KERNELS[self.kernel]

    @property
    def polynomial_kernel(self) -> PolynomialKernel:
        """The kernel, for what works with polynomials only; InputError where it is none."""
        kernel = self.density_kernel
        if not isinstance(kernel, PolynomialKernel):
            raise InputError(
                f"The kernel {kernel.label} is no polynomial, so only methods that sample draw it, without traced light, the "
                "thickness pass, deep images and clusters; choose another kernel"
            )
        return kernel

    @property
    def threshold(self) -> float:
        """What the sum of the balls' densities is at the surface."""
        return self.density_kernel.threshold(self.isovalue)

    def kernel_radii(self, radii: npt.NDArray[np.floating], weights: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """Radii of the kernel spheres, the isosurfaces that the balls would have alone.

        Parameters
        ----------
        radii, weights
            Influence radii and weights, shape (N,), world units and dimensionless.

        Returns
        -------
        (N,) float64, world units; 0 where a ball alone has no surface. ``r0 = R sqrt(1 - x0)`` with
        ``q f(x0) = threshold`` (Kanamori et al. 2008, section 5.2).
        """
        # Millions of balls have a handful of weights.
        values, which = np.unique(np.asarray(weights, np.float64), return_inverse=True)
        ratio = np.divide(self.threshold, values, out=np.full_like(values, np.inf), where=values > 0)
        x0 = self.density_kernel.inverse(ratio)
        shares = np.where(np.isnan(x0), 0.0, np.sqrt(np.maximum(1 - x0, 0)))
        kernel_radii: npt.NDArray[np.float64] = np.asarray(radii, np.float64) * shares[which]
        return kernel_radii
