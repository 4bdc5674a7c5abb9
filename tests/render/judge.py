"""Compares an image with the oracle, ray by ray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import meniscus
from meniscus.addon.fluid.kernels import KERNELS

# A ray whose density has an extremum this close to the isovalue cannot be decided in single precision.
UNDECIDABLE = 1e-4


@dataclass
class Expected:
    """What the oracle says of every pixel: (pixels,) unless said; distances along unit rays."""

    origins: np.ndarray
    directions: np.ndarray
    stretch: np.ndarray
    t: np.ndarray
    normals: np.ndarray
    radius: np.ndarray


def expected(balls: meniscus.Balls, field: meniscus.Field, camera: meniscus.Camera) -> Expected:
    """Cast the camera's rays from its near clip distance; `radius` is that of the ball that dominates at the hit."""
    view_origins, view_directions = (array.reshape(-1, 3) for array in camera.view_rays())
    rotation = camera.world_from_view[:3, :3]
    stretch = np.linalg.norm(view_directions, axis=1)
    directions = view_directions / stretch[:, None] @ rotation.T
    origins = view_origins @ rotation.T + camera.eye
    start = camera.clip_start * stretch
    t, normals = meniscus.oracle.cast(balls, field, origins + start[:, None] * directions, directions)
    t = t + start
    t[t > camera.clip_end * stretch] = np.inf
    return Expected(origins, directions, stretch, t, normals, _dominant_radius(balls, field, origins, directions, t))


def _dominant_radius(balls, field, origins, directions, t):
    radius = np.ones(len(t))
    for index in np.flatnonzero(np.isfinite(t)):
        shares = _shares(balls, field, (origins[index] + t[index] * directions[index])[None])[0]
        radius[index] = balls.radii[np.argmax(shares)]
    return radius


def _shares(balls, field, points):
    distance_2 = ((points[:, None] - balls.positions[None].astype(np.float64)) ** 2).sum(-1)
    return balls.weights * KERNELS[field.kernel].value(1 - distance_2 / balls.radii.astype(np.float64) ** 2)


def is_undecidable(balls, field, want: Expected, index: int, camera: meniscus.Camera, t_image: float) -> bool:
    """Whether the density along the ray has an extremum within 1e-4 of the isovalue before the farther of the two hits."""
    far = max(np.nan_to_num(t_image, posinf=0), np.nan_to_num(want.t[index], posinf=0))
    start = camera.clip_start * want.stretch[index]
    if not (np.isfinite(t_image) and np.isfinite(want.t[index])):
        reach = np.linalg.norm(balls.positions - want.origins[index], axis=1) + balls.radii
        far = float(np.max(reach))
    t = np.linspace(start, far, 4001)
    for _ in range(3):
        density = _shares(balls, field, want.origins[index] + t[:, None] * want.directions[index]).sum(-1)
        closeness = np.abs(density - field.isovalue)
        extrema = np.flatnonzero((np.diff(density)[1:] >= 0) != (np.diff(density)[:-1] >= 0)) + 1
        if not len(extrema):
            return False
        best = extrema[np.argmin(closeness[extrema])]
        if closeness[best] <= UNDECIDABLE:
            return True
        t = np.linspace(t[best - 1], t[best + 1], 401)
    return False


def judge(image: meniscus.ImageBuffers, scene, camera: meniscus.Camera) -> None:
    """Assert the bounds that every exact method keeps: hits, distances, normals."""
    balls, field = scene.balls, scene.field
    want = expected(balls, field, camera)
    hit = image.hit.ravel()
    t = np.where(hit, image["depth"].ravel() * want.stretch, np.inf)
    should_hit = np.isfinite(want.t)
    both = hit & should_hit
    error = np.zeros(len(t))
    error[both] = np.abs(t[both] - want.t[both]) / want.radius[both]

    suspects = np.flatnonzero((hit != should_hit) | (error > 1e-3))
    undecidable = [index for index in suspects if is_undecidable(balls, field, want, index, camera, t[index])]
    wrong = [
        f"{divmod(int(index), camera.width)}: t = {t[index]:.7g}, oracle {want.t[index]:.7g}, R = {want.radius[index]:.2g}"
        for index in suspects
        if index not in undecidable
    ]
    assert not wrong, f"{len(wrong)} wrong pixels of {both.sum()}: {wrong[:5]}"
    assert len(undecidable) <= 0.002 * len(t), f"{len(undecidable)} pixels cannot be decided; the scene is no use"

    sure = both.copy()
    sure[undecidable] = False
    assert np.sqrt(np.mean(error[sure] ** 2)) <= 1e-4
    cosine = np.einsum("ij,ij->i", image["normal"].reshape(-1, 3)[sure].astype(np.float64), want.normals[sure])
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    assert angle.max(initial=0.0) <= 0.5
