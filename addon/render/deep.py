"""Deep images: what a camera sees of a fluid, spread over the parts of its rays that lie in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.deep_image import DeepImage
from ..fluid.field import Field
from ..fluid.image import ImageBuffers
from ..fluid.look import Look
from .method import timed
from .renderer import render, watch_of
from .settings import Value
from .spans import Spans, find_spans
from .surroundings import Backdrop


def render_deep(
    balls: Balls,
    camera: Camera,
    field: Field,
    method: str = "auto",
    backend: str = "auto",
    look: Look | None = None,
    is_cancelled: Callable[[], bool] | None = None,
    on_progress: Callable[[float], None] | None = None,
    threads: int = 0,
    backdrop: Backdrop | None = None,
    settings: Mapping[str, Value] | None = None,
) -> DeepImage:
    """Render the inside of a fluid along the rays through the centres of the pixels.

    The parameters and the errors are those of :func:`renderer.render`; of a backdrop only the depth counts, at which the fluid
    ends, not the colours.

    Returns
    -------
    DeepImage with a sample for each span of a ray in the fluid. The light that the look takes from what is behind is shared
    among the spans of a ray by their length (Lambert and Beer), so that the image, flattened, is the Combined pass. Fluid that
    is opaque hides all behind its first sample.
    """
    hiding = None if backdrop is None else _colorless(backdrop, camera)
    image = render(
        *(balls, camera, field, method, backend, ("combined", "depth"), look, is_cancelled, on_progress, threads, hiding),
        settings=settings,
    )
    region = camera.cropped()
    with timed(image.info.milliseconds, "spans"):
        spans = find_spans(balls, region, field, threads=threads, watch=watch_of(is_cancelled, on_progress))
        if backdrop is not None:
            spans = spans.before(backdrop.depth)
    return _deep_image(image, spans)


def _colorless(backdrop: Backdrop, camera: Camera) -> Backdrop:
    """What hides the fluid in the same way, and leaves a hole."""
    empty = Backdrop.empty(camera.cropped())
    return replace(backdrop, rgba=empty.rgba, is_holdout=np.broadcast_to(np.True_, backdrop.depth.shape))


def _deep_image(image: ImageBuffers, spans: Spans) -> DeepImage:
    camera = image.camera
    region = np.s_[
        camera.active_region.y_min : camera.active_region.y_max, camera.active_region.x_min : camera.active_region.x_max
    ]
    rgba, depth = (np.ascontiguousarray(image[name][region]) for name in ("combined", "depth"))
    hit = np.ascontiguousarray(image.hit[region]).reshape(-1)
    pixel, enter, leave, length, normal = _at_hits(hit, depth.reshape(-1), spans)
    counts = np.zeros((camera.height, camera.width), np.int32)
    counts[region] = np.bincount(pixel, minlength=hit.size).reshape(spans.shape)
    near, far = _tidy(pixel, enter, leave)
    colors = _shared(rgba.reshape(-1, 4)[pixel], pixel, length, hit.size)
    return DeepImage(camera, counts, near, far, colors, normal, image.info)


def _at_hits(
    hit: npt.NDArray[np.bool_], depth: npt.NDArray[np.float32], spans: Spans
) -> tuple[
    npt.NDArray[np.int64], npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float32]
]:
    """Pixel, ends, length and normal of the spans, for those pixels alone where the image has fluid, and for each of them.

    Rays that only touch the fluid may be seen by one search and not by the other.
    """
    seen = hit[spans.pixel]
    touched = hit.copy()
    touched[spans.pixel] = False
    extra = np.flatnonzero(touched)
    pixel = np.concatenate([spans.pixel[seen], extra])
    enter = np.concatenate([spans.enter[seen], depth[extra]])
    leave = np.concatenate([spans.leave[seen], depth[extra]])
    length = np.concatenate([spans.length[seen], np.zeros(len(extra))])
    normal = np.concatenate([spans.normal[seen], np.zeros((len(extra), 3), np.float32)])
    order = np.lexsort((enter, pixel))
    return pixel[order], enter[order], leave[order], length[order], normal[order]


def _tidy(
    pixel: npt.NDArray[np.int64], enter: npt.NDArray[np.float64], leave: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Depths as floats, rounded so that no sample of a pixel ends behind the next one's start."""
    near, far = enter.astype(np.float32), np.maximum(leave, enter).astype(np.float32)
    is_followed = pixel[1:] == pixel[:-1]
    far[:-1][is_followed] = np.minimum(far[:-1], near[1:])[is_followed]
    return near, np.maximum(far, near)


def _shared(
    rgba: npt.NDArray[np.float32], pixel: npt.NDArray[np.int64], length: npt.NDArray[np.float64], pixels: int
) -> npt.NDArray[np.float32]:
    """(samples, 4): each sample's share of the colour of its pixel, by its length."""
    total = np.bincount(pixel, length, pixels)[pixel]
    samples = np.bincount(pixel, minlength=pixels)[pixel]
    share = np.where(total > 0, length / np.where(total > 0, total, 1), 1 / samples)
    alpha = rgba[:, 3].astype(np.float64)
    own = 1 - (1 - np.clip(alpha, 0, 1)) ** share
    # What shines without hiding has no alpha to go by.
    factor = np.where(alpha > 1e-6, own / np.where(alpha > 1e-6, alpha, 1), share)
    return np.concatenate([rgba[:, :3] * factor[:, None], own[:, None]], axis=1, dtype=np.float32)
