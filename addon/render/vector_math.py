"""Formulas of light on arrays of vectors."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]


def dot(first: FloatArray, second: FloatArray) -> FloatArray:
    """(count,) products of vectors (count, 3) or (3,)."""
    return np.asarray((first * second).sum(axis=-1), np.float32)


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) of the length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def highlight(normal: FloatArray, to_eye: FloatArray, light: FloatArray, roughness: npt.ArrayLike) -> FloatArray:
    """What of a light's irradiance facets send to the eye, without what they let pass.

    Trowbridge and Reitz's distribution of facets (GGX), with the usual approximation of what they hide (Karis 2013);
    `roughness` is one number or (count,).
    """
    between = unit(to_eye + light)
    alpha = np.maximum(np.square(roughness, dtype=np.float32), np.float32(0.002))
    spread = np.maximum(dot(normal, between), 0) ** 2 * (alpha * alpha - 1) + 1
    near = np.maximum(dot(light, between), 0.1)
    facets = alpha * alpha / (4 * np.pi * spread * spread * near * near * (alpha + 0.5))
    return np.asarray(np.minimum(facets * np.maximum(dot(normal, light), 0), 16))


def schlick(cosine: FloatArray, straight: FloatArray) -> FloatArray:
    """(count, 3): what a surface reflects at angles (count,) to its normal, given what it reflects straight on (count, 3)."""
    return np.asarray(straight + (1 - straight) * (1 - np.clip(cosine, 0, 1))[:, None] ** 5)


def fresnel(cosine: FloatArray, ior: float | FloatArray) -> FloatArray:
    """What of unpolarized light a smooth surface reflects; `ior` is one number or has the shape of `cosine`."""
    within = np.sqrt(np.maximum(1 - (1 - cosine**2) / np.square(ior, dtype=np.float32), 0))
    across = (cosine - ior * within) / (cosine + ior * within)
    along = (ior * cosine - within) / (ior * cosine + within)
    return np.asarray(0.5 * (across**2 + along**2), np.float32)
