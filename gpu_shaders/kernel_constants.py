"""Density kernels as constants of shaders, and what they read of them."""

from __future__ import annotations

import moderngl
import numpy as np

from ..addon.fluid.density_profile import DensityProfile
from ..addon.fluid.kernels import LEAST_SHARE, Kernel, PolynomialKernel
from .image_cells import plain


def kernel_constants(kernel: Kernel) -> dict[str, object]:
    """The kernel as lib/kernel.glsl wants it: a polynomial as ``x^power (low + high x)``."""
    if not isinstance(kernel, PolynomialKernel):
        is_profile = int(isinstance(kernel, DensityProfile))
        least = f"float({LEAST_SHARE!r})"
        return {"KERNEL_IS_POLYNOMIAL": 0, "KERNEL_IS_PROFILE": is_profile, "KERNEL_LEAST_SHARE": least}
    power = {1: 1, 2: 2, 3: 2, 4: 4}[len(kernel.coefficients) - 1]
    low, high = (*kernel.coefficients, 0.0)[power : power + 2]
    return {
        "KERNEL_IS_POLYNOMIAL": 1,
        "KERNEL_DEGREE": kernel.ray_degree,
        "KERNEL_POWER": power,
        "KERNEL_LOW": f"float({low!r})",
        "KERNEL_HIGH": f"float({high!r})",
    }


def kernel_textures(gl: moderngl.Context, kernel: Kernel) -> dict[str, moderngl.Texture]:
    """What lib/kernel.glsl reads of a kernel, by sampler name: a table of densities."""
    if not isinstance(kernel, DensityProfile):
        return {}
    table = np.array(kernel.densities, np.float32)
    return {"profile_tx": plain(gl.texture((len(table), 1), 1, table, dtype="f4"))}
