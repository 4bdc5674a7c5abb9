"""The search for a particle's neighbours: in an image, as the paper has it, or in a grid (section 7.3.3)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import moderngl
import numpy as np

from ...compute_step import ComputeStep
from ...context import GpuContext
from ...image_cells import plain
from ...occlusion import OcclusionQueries
from ...step import Step
from ...storage import Storage
from .programs import THREADS, grid_programs, image_programs
from .state import ParticleState, Pressures

_MOST_LAYERS = 24
"""Particles at one pixel that are told apart; others are not pushed in this step, and the next image is another."""

_PIXELS_A_CELL = 5
"""Of the image: more tell particles apart better, fewer are drawn faster."""

_PIXELS_A_PARTICLE = 16
"""Of the image, at least."""

_LEAST_SIDE = 64
"""Of the image, in pixels; a particle's square has to fit in."""


_SLACK = 1.0001
"""How much wider the widest cell is than the farthest reach, which may be rounded."""


@dataclass(frozen=True)
class Reaches:
    """How far particles push one another.

    Attributes
    ----------
    share
        In influence radii.
    radii
        The least and the greatest influence radius, Blender units.
    """

    share: float
    radii: tuple[float, float]

    @property
    def levels(self) -> int:
        """How many sizes of cells there are, each half as wide as the one before."""
        least, greatest = self.radii
        return 1 + int(math.log2(_SLACK * greatest / least))

    def side(self, level: int) -> float:
        """Of the cells of a level, Blender units."""
        return float(_SLACK * self.share * self.radii[1] * 2.0**-level)

    @property
    def uniforms(self) -> dict[str, object]:
        """What crowd.glsl asks of it."""
        return {"reach": self.share, "widest": self.side(0), "level_count": self.levels}


class Crowd(Protocol):
    """Finds out what particles do to one another."""

    def press(self, state: ParticleState, reaches: Reaches, step: int, pressures: Pressures) -> None:
        """Write the pressure on each; `step` is a number that differs from step to step."""
        ...


class ImageCrowd:
    """The search in an image: OpenGL 3.3.

    The image is folded, so that it has the same resolution for fluid of any size, and drawn in layers, so that no particle is
    hidden by another; each step looks from another side.
    """

    def __init__(self, context: GpuContext) -> None:
        self._context = context
        self._steps = {name: Step(context, source) for name, source in image_programs().items()}
        self._queries = OcclusionQueries(context)
        self._images: _CrowdImages | None = None

    def press(self, state: ParticleState, reaches: Reaches, step: int, pressures: Pressures) -> None:
        """See :meth:`Crowd.press`."""
        gl, images = self._context.gl, self._images_for(state.count)
        pressures.framebuffer.clear()
        uniforms = {
            **state.uniforms,
            **reaches.uniforms,
            "image_axes": _image_axes(step),
            "image_side": images.side,
        }
        self._set_uniforms(uniforms)
        gl.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE
        for level in range(reaches.levels):
            self._set_uniforms({"level": level, "pixel_width": reaches.side(level) / _PIXELS_A_CELL})
            self._press_level(state, images, pressures)

    def _set_uniforms(self, values: Mapping[str, object]) -> None:
        for step in self._steps.values():
            step.set_uniforms(values)

    def _press_level(self, state: ParticleState, images: _CrowdImages, pressures: Pressures) -> None:
        gl = self._context.gl
        for number, query in enumerate(self._queries.take(_MOST_LAYERS)):
            layer, before = images.layers[number % 2], images.layers[1 - number % 2]
            read = {**state.textures, "layer_tx": before.texture}
            layer.framebuffer.clear(depth=1.0)
            gl.enable_only(moderngl.DEPTH_TEST)
            gl.depth_func = "<"
            self._steps["mark"].set_uniforms({"is_first": number == 0})
            with query.asked():
                self._steps["mark"].draw(layer.framebuffer, moderngl.POINTS, state.count, read)
            images.pushed.clear()
            read = {**state.textures, **images.textures, "layer_tx": layer.texture}
            with query.required():
                gl.enable_only(moderngl.BLEND)
                self._steps["push"].draw(images.pushed, moderngl.TRIANGLES, 24 * state.count, read)
                self._steps["collect"].draw_plainly(pressures.framebuffer, read)

    def _images_for(self, count: int) -> _CrowdImages:
        side = max(_LEAST_SIDE, 1 << (int(np.ceil(np.sqrt(count * _PIXELS_A_PARTICLE))) - 1).bit_length())
        side = min(side, self._context.limits.texture_size, self._context.limits.viewport_size)
        if self._images is None or self._images.side != side:
            self._images = None  # its memory may be needed
            self._images = _CrowdImages(self._context, side)
        return self._images


class _Layer:
    """The numbers of the particles at the pixels."""

    def __init__(self, context: GpuContext, side: int) -> None:
        self.texture = plain(context.gl.texture((side, side), 1, dtype="u4"))
        self.framebuffer = context.gl.framebuffer([self.texture], context.depth_texture((side, side)))


class _CrowdImages:
    """What is drawn into, for one size."""

    def __init__(self, context: GpuContext, side: int) -> None:
        self.side = side
        self.layers = _Layer(context, side), _Layer(context, side)
        forces = plain(context.gl.texture((side, side), 4, dtype="f4"))
        companions = plain(context.gl.texture((side, side), 1, dtype="f4"))
        self.textures = {"pushed_tx": forces, "companions_tx": companions}
        self.pushed = context.gl.framebuffer([forces, companions])


def _image_axes(step: int) -> tuple[float, ...]:
    """Two unit vectors at right angles, by columns; others in each step, along no axis."""
    first, second = np.linalg.qr(np.random.default_rng(step).normal(size=(3, 2)))[0].T
    return (*first.tolist(), *second.tolist())


class GridCrowd:
    """The search in a grid: OpenGL 4.3."""

    def __init__(self, context: GpuContext) -> None:
        context.require(430, storage_blocks=3)
        self._context, self._storage = context, Storage(context)
        self._steps = {name: ComputeStep(context, source) for name, source in grid_programs().items()}
        self._buffers: tuple[int, list[moderngl.Buffer]] | None = None

    def press(self, state: ParticleState, reaches: Reaches, step: int, pressures: Pressures) -> None:
        """See :meth:`Crowd.press`."""
        buckets = 1 << (state.count - 1).bit_length()
        for binding, buffer in enumerate(self._buffers_for(buckets)):
            self._storage.fill(buffer, 0)
            buffer.bind_to_storage_buffer(binding)
        pressures.bind_to_images()
        for name, each in self._steps.items():
            each.set_uniforms({**state.uniforms, **reaches.uniforms, "bucket_count": buckets})
            each.use_textures(state.textures)
            threads = buckets if name in ("grid_allot", "grid_sort") else state.count
            each.run_in_lines(-(-threads // THREADS))

    def _buffers_for(self, buckets: int) -> list[moderngl.Buffer]:
        """The counts, the buckets, and as many members at most."""
        if self._buffers is None or self._buffers[0] != buckets:
            self._buffers = None  # its memory may be needed
            self._buffers = buckets, [self._storage.reserve(size) for size in (16, 8 * buckets, 4 * buckets)]
        return self._buffers[1]


def best_crowd(context: GpuContext) -> Crowd:
    """The grid where there are compute shaders, else the image."""
    return GridCrowd(context) if context.version >= 430 else ImageCrowd(context)
