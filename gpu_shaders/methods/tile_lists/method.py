"""Runs the shaders of Tile Lists; see the package for what it does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import moderngl
import numpy as np

from ....addon.fluid.camera import Camera, Region
from ....addon.fluid.field import Field
from ....addon.fluid.kernels import KERNELS, Kernel
from ....addon.fluid.passes import DEPTH_BACKGROUND
from ....addon.render.method import Attribute, Request, Surface, timed
from ...camera_parts import camera_uniforms, image_parts
from ...compute_step import ComputeStep
from ...context import GpuContext, shared_context
from ...storage import Storage
from ...surface_textures import SurfaceTextures
from .balls import BallBuffers, kernel_shares, least_x
from .memory import FILL_GROUPS_OFFSET, LONG_GROUPS_OFFSET, Memory
from .params import METHOD
from .programs import LIST_LENGTH, SHORT_LIST, SOFTWARE_SHORT_LIST, THREADS, Variant

_STORAGE_BLOCKS = 15
"""Binding points that are used."""

_PIXELS_A_PART = 1 << 23
_MOST_TRIES = 4
_IMAGES = {"depth": 0, "normal": 1, "color": 2, "velocity": 3, "ball": 4}
"""Binding points."""

_ATTRIBUTES: tuple[Attribute, ...] = ("color", "velocity", "ball")
_SAMPLE = 16
"""One of so many balls is drawn before all others."""

_ROOM = 1.25
"""How much larger than needed buffers become, so that the next frame fits as well."""


class TileLists:
    """The method on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    list_length
        Balls that a ray may be in before it goes on without a list.
    """

    def __init__(self, context: GpuContext, list_length: int = LIST_LENGTH) -> None:
        context.require(METHOD.gl_version, storage_blocks=_STORAGE_BLOCKS)
        self._context = context
        self._list_length = list_length
        self._short_list = SOFTWARE_SHORT_LIST if context.is_software else SHORT_LIST
        self._storage = Storage(context)
        self._steps: dict[Variant, dict[str, ComputeStep]] = {}
        self._balls: BallBuffers | None = None
        self._memory: dict[tuple[int, int], Memory] = {}
        # A driver that rejects the shaders is to be known before the method is chosen.
        context.run(lambda: self._steps_of(self._variant(KERNELS["wyvill"])))

    @property
    def device(self) -> str:
        """What the driver calls the graphics processor."""
        return str(self._context.renderer)

    @property
    def shares_textures(self) -> bool:
        """See :meth:`method.DeviceMethod.shares_textures`."""
        return self._context.shares

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        attributes = _wanted(request)
        surface = _background(request.camera, attributes)
        if len(request.balls):
            with timed(surface.milliseconds, "surface"):
                for region in self._parts(request.camera):
                    request.watch(region.y_min / request.camera.height)
                    self._context.run(partial(self._find_part, request, attributes, region, surface))
        return surface

    def find_surface_on_device(self, request: Request) -> SurfaceTextures:
        """See :meth:`method.DeviceMethod.find_surface_on_device`."""
        camera = request.camera
        milliseconds: dict[str, float] = {}
        self._context.require(METHOD.gl_version, texture_size=max(camera.width, camera.height))
        request.watch(0.0)
        with timed(milliseconds, "surface"):
            textures = self._context.run(lambda: self._find_on_device(request))
        textures.milliseconds |= milliseconds
        return textures

    def _parts(self, camera: Camera) -> Iterator[Region]:
        return image_parts(camera, _PIXELS_A_PART, self._context.limits.texture_size)

    def _find_part(self, request: Request, attributes: tuple[Attribute, ...], region: Region, surface: Surface) -> None:
        """Fill a part of `surface`; on the context's thread."""
        camera = replace(request.camera, region=region).cropped()
        textures = SurfaceTextures(self._context, (camera.width, camera.height), attributes)
        self._frame(request, attributes, camera).find(textures)
        rows, columns = slice(region.y_min, region.y_max), slice(region.x_min, region.x_max)
        for name in textures.passes:
            getattr(surface, name)[rows, columns] = textures.read(name)
        for times, more in ((surface.milliseconds, textures.milliseconds), (surface.counts, textures.counts)):
            times |= {name: times.get(name, 0) + number for name, number in more.items()}

    def _find_on_device(self, request: Request) -> SurfaceTextures:
        """On the context's thread."""
        camera, attributes = request.camera, _wanted(request)
        textures = SurfaceTextures(self._context, (camera.width, camera.height), attributes)
        if len(request.balls):
            self._frame(request, attributes, camera).find(textures)
        else:
            textures.clear()
        # Another context sees what is finished; it could not wait for what is not.
        self._context.gl.finish()
        return textures

    def _frame(self, request: Request, attributes: tuple[Attribute, ...], camera: Camera) -> _Frame:
        wanted = frozenset(attributes)
        if self._balls is None or self._balls.balls is not request.balls or not self._balls.has(wanted):
            self._balls = None  # its memory may be needed
            self._balls = BallBuffers.upload(self._storage, request.balls, wanted)
        size = camera.width, camera.height
        if size not in self._memory:
            self._memory = {size: Memory(self._storage, *size)}
        steps = self._steps_of(self._variant(request.field.density_kernel, self._balls.weight is None, wanted))
        return _Frame(self._context, steps, self._balls, self._memory[size], camera, request.field)

    def _variant(self, kernel: Kernel, with_weights: bool = False, attributes: frozenset[Attribute] = frozenset()) -> Variant:
        return Variant(kernel, with_weights, attributes, self._list_length, self._short_list)

    def _steps_of(self, variant: Variant) -> dict[str, ComputeStep]:
        if variant not in self._steps:
            self._steps[variant] = {name: ComputeStep(self._context, program) for name, program in variant.programs().items()}
        return self._steps[variant]


class _Frame:
    """Finds the surface in one image; made and used on the context's thread."""

    def __init__(
        self,
        context: GpuContext,
        steps: dict[str, ComputeStep],
        balls: BallBuffers,
        memory: Memory,
        camera: Camera,
        field: Field,
    ) -> None:
        self._context, self._steps, self._balls, self._memory, self._camera = context, steps, balls, memory, camera
        tables = {4: kernel_shares(field), 12: least_x(field, float(balls.balls.weights.max()))}
        self._tables = {binding: memory.storage.of(table) for binding, table in tables.items()}
        uniforms = {
            **camera_uniforms(camera),
            "list_count": memory.grid.tile_count,
            "isovalue": field.isovalue,
            "ball_count": len(balls.balls),
            "weight_of_all": balls.weight or 0.0,
            "eye": tuple(camera.eye.tolist()),
            # By columns, as OpenGL has it: of the transposed rotation.
            "view_from_world": tuple(camera.world_from_view[:3, :3].ravel().tolist()),
        }
        for step in steps.values():
            step.set_uniforms(uniforms)

    def find(self, textures: SurfaceTextures) -> None:
        """Fill the textures."""
        for _ in range(_MOST_TRIES):
            self._set_capacities()
            times = _Times(self._context)
            self._make_lists(times)
            self._cast(textures, times)
            seen, entries, crowded, longest = np.frombuffer(self._memory.counts.read(16), np.uint32).tolist()
            if seen <= self._memory.seen_capacity and entries <= self._memory.entry_capacity:
                break
            self._memory.grow(
                max(int(_ROOM * seen), self._memory.seen_capacity), max(int(_ROOM * entries), self._memory.entry_capacity)
            )
        textures.milliseconds = times.milliseconds
        textures.counts = {"balls_drawn": seen, "entries": entries, "longest_list": longest, "crowded_rays": crowded}

    def _set_capacities(self) -> None:
        capacities = {"seen_capacity": self._memory.seen_capacity, "entry_capacity": self._memory.entry_capacity}
        for step in self._steps.values():
            step.set_uniforms(capacities)

    def _make_lists(self, times: _Times) -> None:
        memory, steps = self._memory, self._steps
        memory.begin()
        for binding, buffer in (*self._balls.buffers.items(), *self._tables.items()):
            buffer.bind_to_storage_buffer(binding)
        with times.of("occlude"):
            self._occlude(_SAMPLE)
            self._occlude(1)
        with times.of("cull"):
            steps["cull"].run_in_lines(self._groups(1))
        with times.of("bin"):
            steps["scan"].run(1)
            steps["fill"].run_indirect(memory.counts, FILL_GROUPS_OFFSET)
        with times.of("sort"):
            steps["sort_short"].run_in_lines(-(-memory.grid.tile_count // 64))
            steps["sort_long"].run_indirect(memory.counts, LONG_GROUPS_OFFSET)

    def _occlude(self, step_size: int) -> None:
        """Draw the kernel spheres of one of so many balls, and make the pyramid of what they hide."""
        steps, grid = self._steps, self._memory.grid
        self._memory.forget_large()
        steps["occlude"].set_uniforms({"step_size": step_size, "is_sampled": step_size > 1})
        steps["occlude"].run_in_lines(self._groups(step_size))
        steps["occlude_large"].run_indirect(self._memory.large, 0)
        for level in range(0, grid.levels, 4):
            steps["pyramid"].set_uniforms({"base_level": level})
            columns, rows = (-(-side // 2**level) for side in grid.cells)
            steps["pyramid"].run(-(-columns // 16), -(-rows // 16))

    def _groups(self, step_size: int) -> int:
        """Groups of threads, one thread for each of one of so many balls."""
        return -(-len(self._balls.balls) // (step_size * THREADS))

    def _cast(self, textures: SurfaceTextures, times: _Times) -> None:
        for name, texture in textures.textures.items():
            texture.bind_to_image(_IMAGES[name], read=False, write=True)
        with times.of("cast"):
            self._steps["cast"].run(-(-self._camera.width // 8), -(-self._camera.height // 8))


class _Times:
    """How long the graphics processor works on each stage."""

    def __init__(self, context: GpuContext) -> None:
        self._context = context
        self._queries: dict[str, moderngl.Query] = {}

    @contextmanager
    def of(self, stage: str) -> Iterator[None]:
        """Measure a stage."""
        self._queries[stage] = query = self._context.gl.query(time=True)
        with query:
            yield

    @property
    def milliseconds(self) -> dict[str, float]:
        """By stage; waits for them."""
        return {stage: query.elapsed / 1e6 for stage, query in self._queries.items()}


def create() -> TileLists:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(TileLists)


def _wanted(request: Request) -> tuple[Attribute, ...]:
    """The attributes that are asked for and known."""
    known = {"color": request.balls.colors, "velocity": request.balls.velocities, "ball": request.balls}
    return tuple(name for name in _ATTRIBUTES if name in request.attributes and known[name] is not None)


def _background(camera: Camera, attributes: tuple[Attribute, ...]) -> Surface:
    """The surface of nothing, to be filled."""
    shape = camera.height, camera.width
    normal, color, velocity = (
        np.zeros((*shape, 3), np.float32) if name in ("normal", *attributes) else None
        for name in ("normal", "color", "velocity")
    )
    assert normal is not None
    ball = np.full(shape, -1, np.int32) if "ball" in attributes else None
    return Surface(np.full(shape, DEPTH_BACKGROUND, np.float32), normal, color, velocity, ball)
