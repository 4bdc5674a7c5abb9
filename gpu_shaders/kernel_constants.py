"""Density kernels as constants of shaders."""

from __future__ import annotations

from ..addon.fluid.kernels import LEAST_SHARE, Kernel, PolynomialKernel


def kernel_constants(kernel: Kernel) -> dict[str, object]:
    """The kernel as lib/kernel.glsl wants it: a polynomial as ``x^power (low + high x)``."""
    if not isinstance(kernel, PolynomialKernel):
        return {"KERNEL_IS_POLYNOMIAL": 0, "KERNEL_LEAST_SHARE": f"float({LEAST_SHARE!r})"}
    power = {1: 1, 2: 2, 3: 2, 4: 4}[len(kernel.coefficients) - 1]
    low, high = (*kernel.coefficients, 0.0)[power : power + 2]
    return {
        "KERNEL_IS_POLYNOMIAL": 1,
        "KERNEL_DEGREE": kernel.ray_degree,
        "KERNEL_POWER": power,
        "KERNEL_LOW": f"float({low!r})",
        "KERNEL_HIGH": f"float({high!r})",
    }
