"""Compares an image with the oracle, ray by ray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import meniscus
from meniscus.addon.fluid.kernels import KERNELS

# A ray whose density has an extremum this close to the isovalue cannot be decided in single precision.
UNDECIDABLE = 1e-4


@dataclass(frozen=True)
class Bounds:
    """How much an image may be off.

    Attributes
    ----------
    wrong
        The share of pixels, of those that can be decided, that may hit where they should not or not where they should, or at
        a distance off by more than `distance`.
    distance, rms
        |dt| / R of the others, R of the ball that dominates at the hit.
    angle, tilted
        Between normals, degrees; and the share of pixels that may be off by more.
    """

    wrong: float
    distance: float
    rms: float
    angle: float
    tilted: float


EXACT = Bounds(wrong=0.0, distance=1e-3, rms=1e-4, angle=0.5, tilted=0.0)
# Methods that sample state what they may miss. A normal jumps at creases, which power_1 has, so a small error makes it another.
BOUNDS = {
    "equal_interval": Bounds(wrong=1e-3, distance=0.02, rms=1e-3, angle=0.5, tilted=2e-3),
    "walking_depth_plane": Bounds(wrong=1e-3, distance=5e-3, rms=1e-4, angle=0.5, tilted=2e-3),
    # Its last step is 2 R / 10 samples / 2^4 bisections.
    "vicinity": Bounds(wrong=1e-3, distance=0.0125, rms=5e-4, angle=1.0, tilted=2e-3),
    # Where discs cover a pixel its place is exact; at edges, and in creases narrower than a disc, none may lead to the surface.
    "surface_particles": Bounds(wrong=2e-3, distance=2e-3, rms=1e-4, angle=0.5, tilted=2e-3),
    # The same in double precision. A droplet of a few pixels, or what shows of a ball between others, may have no disc where a
    # ray meets it, and a ray that grazes may be led past.
    "disc_caster": Bounds(wrong=1e-3, distance=1e-3, rms=1e-4, angle=0.5, tilted=0.0),
}


def bounds_of(method: str) -> Bounds:
    """What the method states of itself."""
    return BOUNDS.get(method, EXACT)


@dataclass
class Expected:
    """What the oracle says of every pixel: (pixels,) unless said; distances along unit rays."""

    origins: np.ndarray
    directions: np.ndarray
    stretch: np.ndarray
    t: np.ndarray
    normals: np.ndarray
    radius: np.ndarray


def expected(
    balls: meniscus.Balls, field: meniscus.Field, camera: meniscus.Camera, pixels: np.ndarray | slice = slice(None)
) -> Expected:
    """Cast the camera's rays, or those of some pixels, from its near clip distance; `radius` is that of the ball that
    dominates at the hit.
    """
    view_origins, view_directions = (array.reshape(-1, 3)[pixels] for array in camera.view_rays())
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


def _met_by(balls, origin, direction):
    """The balls whose influence spheres a line meets: no other has a share along it."""
    to_centre = balls.positions.astype(np.float64) - origin
    distance_2 = (to_centre**2).sum(-1) - (to_centre @ direction) ** 2
    met = np.flatnonzero(distance_2 <= (1.001 * balls.radii) ** 2)
    return meniscus.Balls(balls.positions[met], balls.radii[met], balls.weights[met])


def is_undecidable(balls, field, want: Expected, index: int, camera: meniscus.Camera, t_image: float) -> bool:
    """Whether the density along the ray has an extremum within 1e-4 of the isovalue before the farther of the two hits."""
    balls = _met_by(balls, want.origins[index], want.directions[index])
    far = max(np.nan_to_num(t_image, posinf=0), np.nan_to_num(want.t[index], posinf=0))
    start = camera.clip_start * want.stretch[index]
    if not (np.isfinite(t_image) and np.isfinite(want.t[index])):
        reach = np.linalg.norm(balls.positions - want.origins[index], axis=1) + balls.radii
        far = float(np.max(reach, initial=start))
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


@dataclass
class Verdict:
    """How an image compares with the oracle.

    Attributes
    ----------
    compared
        Pixels that hit in both.
    wrong
        A line for each pixel that is wrong, and decidable.
    undecidable
        How many pixels differ where nothing can be decided.
    worst, rms
        |dt| / R, R of the ball that dominates at the hit.
    relative_rms
        |dt| / t, as Kanamori, Szego and Nishita 2008, section 6, measure it.
    worst_angle, tilted
        Between normals, degrees; and how many pixels are off by more than the bound.
    """

    compared: int
    wrong: list[str]
    undecidable: int
    worst: float
    rms: float
    relative_rms: float
    worst_angle: float
    tilted: int


def compare(image: meniscus.ImageBuffers, scene, camera: meniscus.Camera, pixels: np.ndarray | slice = slice(None)) -> Verdict:
    """Compare every pixel of an image, or some, with the oracle; what is wrong goes by the bounds of its method."""
    bounds = bounds_of(image.info.method)
    want = expected(scene.balls, scene.field, camera, pixels)
    places = np.arange(camera.width * camera.height)[pixels]
    hit, should_hit = image.hit.ravel()[pixels], np.isfinite(want.t)
    t = np.where(hit, image["depth"].ravel()[pixels] * want.stretch, np.inf)
    both = hit & should_hit
    error = np.zeros(len(t))
    error[both] = np.abs(t[both] - want.t[both]) / want.radius[both]
    suspects = np.flatnonzero((hit != should_hit) | (error > bounds.distance))
    undecidable = [index for index in suspects if is_undecidable(scene.balls, scene.field, want, index, camera, t[index])]
    wrong = [
        f"{divmod(int(places[index]), camera.width)}: t = {t[index]:.7g}, oracle {want.t[index]:.7g}, "
        f"R = {want.radius[index]:.2g}"
        for index in suspects
        if index not in undecidable
    ]
    both[suspects if bounds.wrong else undecidable] = False
    normals = image["normal"].reshape(-1, 3)[pixels][both].astype(np.float64)
    cross = np.cross(normals, want.normals[both])
    dot = np.einsum("ij,ij->i", normals, want.normals[both])
    angle = np.degrees(np.arctan2(np.linalg.norm(cross, axis=1), dot))
    return Verdict(
        compared=int(both.sum()),
        wrong=wrong,
        undecidable=len(undecidable),
        worst=float(error[both].max(initial=0.0)),
        rms=_rms(error[both]),
        relative_rms=_rms(error[both] * want.radius[both] / want.t[both]),
        worst_angle=float(angle.max(initial=0.0)),
        tilted=int(np.count_nonzero(angle > bounds.angle)),
    )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def judge(image: meniscus.ImageBuffers, scene, camera: meniscus.Camera) -> None:
    """Assert the bounds of the image's method: hits, distances, normals."""
    verdict, bounds = compare(image, scene, camera), bounds_of(image.info.method)
    pixels = camera.width * camera.height
    wrong = f"{len(verdict.wrong)} wrong pixels of {verdict.compared}: {verdict.wrong[:5]}"
    assert len(verdict.wrong) <= bounds.wrong * pixels, wrong
    assert verdict.undecidable <= 0.002 * pixels, "too many pixels cannot be decided"
    assert verdict.worst <= bounds.distance
    assert verdict.rms <= bounds.rms
    assert verdict.tilted <= bounds.tilted * pixels, f"{verdict.tilted} normals are off, by up to {verdict.worst_angle} degrees"
