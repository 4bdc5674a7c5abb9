"""Runs the shaders of Tile Lists; see the package for what it does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TypeVar

from ....addon.fluid.balls import Balls
from ....addon.fluid.camera import Camera, Region
from ....addon.fluid.errors import MeniscusError
from ....addon.fluid.kernels import POLYNOMIAL_KERNELS, PolynomialKernel
from ....addon.render.method import Attribute, Request, Surface, timed
from ...camera_parts import image_parts
from ...compute_step import ComputeStep
from ...context import GpuContext, shared_context
from ...storage import Storage
from ...surface_textures import SurfaceTextures
from .balls import POSITION_BYTES, BallBuffers
from .frame import Frame
from .memory import Memory
from .params import METHOD
from .programs import LIST_LENGTH, Variant
from .slabs import FAR, Slab, slabs

Result = TypeVar("Result")

_STORAGE_BLOCKS = 16
"""Binding points that are used."""

_PIXELS_A_PART = 1 << 23


class TileLists:
    """The method on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    list_length
        Balls that a ray may be in before it goes on without a list.
    most_balls
        How many are searched at once; as many as fit where None.
    """

    def __init__(self, context: GpuContext, list_length: int = LIST_LENGTH, most_balls: int | None = None) -> None:
        context.require(METHOD.gl_version, storage_blocks=_STORAGE_BLOCKS)
        self._context = context
        self._list_length = list_length
        self._most_balls = most_balls
        self._storage = Storage(context)
        self._steps: dict[Variant, dict[str, ComputeStep]] = {}
        self._balls: BallBuffers | None = None
        self._memory: dict[tuple[int, int], Memory] = {}
        # A driver that rejects the shaders is to be known before the method is chosen.
        context.run(lambda: self._steps_of(self._variant(POLYNOMIAL_KERNELS["wyvill"])))

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
        attributes = request.known_attributes
        surface = Surface.background(request.camera, attributes)
        if len(request.balls):
            with timed(surface.milliseconds, "surface"):
                for region in self._parts(request.camera):
                    request.watch(region.y_min / request.camera.height)
                    self._run(partial(self._find_part, request, attributes, region, surface))
        return surface

    def find_surface_on_device(self, request: Request) -> SurfaceTextures:
        """See :meth:`method.DeviceMethod.find_surface_on_device`."""
        camera = request.camera
        milliseconds: dict[str, float] = {}
        self._context.require(METHOD.gl_version, texture_size=max(camera.width, camera.height))
        request.watch(0.0)
        with timed(milliseconds, "surface"):
            textures = self._run(lambda: self._find_on_device(request))
        textures.milliseconds |= milliseconds
        return textures

    def _run(self, work: Callable[[], Result]) -> Result:
        """Do `work` on the context's thread; after an error nothing is kept, as the driver may have refused the memory."""
        try:
            return self._context.run(work)
        except MeniscusError:
            self._balls, self._memory = None, {}
            raise

    def _parts(self, camera: Camera) -> Iterator[Region]:
        return image_parts(camera, _PIXELS_A_PART, self._context.limits.texture_size)

    def _find_part(self, request: Request, attributes: tuple[Attribute, ...], region: Region, surface: Surface) -> None:
        """Fill a part of `surface`; on the context's thread."""
        camera = replace(request.camera, region=region).cropped()
        textures = SurfaceTextures(self._context, (camera.width, camera.height), attributes)
        self._find(request, attributes, camera, textures)
        textures.read_into(surface, region)

    def _find_on_device(self, request: Request) -> SurfaceTextures:
        """On the context's thread."""
        camera, attributes = request.camera, request.known_attributes
        textures = SurfaceTextures(self._context, (camera.width, camera.height), attributes)
        if len(request.balls):
            self._find(request, attributes, camera, textures)
        else:
            textures.clear()
        # Another context sees what is finished; it could not wait for what is not.
        self._context.gl.finish()
        return textures

    def _find(self, request: Request, attributes: tuple[Attribute, ...], camera: Camera, textures: SurfaceTextures) -> None:
        """Fill the textures: with all balls at once or, where they are too many, slab by slab from near to far."""
        balls, wanted = request.balls, frozenset(attributes)
        most = self._most_balls or self._storage.most(POSITION_BYTES)
        steps = self._steps_of(self._variant(request.field.polynomial_kernel, balls.weight is None, wanted))
        frame = Frame(self._context, steps, self._memory_for(camera), camera, request.field)
        if len(balls) <= most and frame.find(self._uploaded(balls, wanted), Slab(-FAR, FAR, balls), textures):
            return
        self._balls = None  # its memory is needed
        parts = 2
        while not self._find_in_slabs(request, wanted, frame, min(most, -(-len(balls) // parts)), camera, textures):
            parts *= 2

    def _find_in_slabs(
        self,
        request: Request,
        attributes: frozenset[Attribute],
        frame: Frame,
        most: int,
        camera: Camera,
        textures: SurfaceTextures,
    ) -> bool:
        """Fill the textures from slabs of at most `most` balls; False where one does not fit into the buffers."""
        textures.clear()
        for slab in slabs(request.balls, camera, most):
            request.watch(0.0)
            with_weights = request.balls.weight is None
            buffers = BallBuffers.upload(self._storage, slab.balls, attributes, with_weights, slab.indices)
            if not frame.find(buffers, slab, textures):
                return False
        return True

    def _uploaded(self, balls: Balls, attributes: frozenset[Attribute]) -> BallBuffers:
        """The balls' buffers, which stay while the same balls are asked for."""
        if self._balls is None or self._balls.balls is not balls or not self._balls.has(attributes):
            self._balls = None  # its memory may be needed
            self._balls = BallBuffers.upload(self._storage, balls, attributes, balls.weight is None)
        return self._balls

    def _memory_for(self, camera: Camera) -> Memory:
        size = camera.width, camera.height
        if size not in self._memory:
            self._memory = {size: Memory(self._storage, *size)}
        return self._memory[size]

    def _variant(
        self, kernel: PolynomialKernel, with_weights: bool = False, attributes: frozenset[Attribute] = frozenset()
    ) -> Variant:
        return Variant(kernel, with_weights, attributes, self._list_length, self._context.is_software)

    def _steps_of(self, variant: Variant) -> dict[str, ComputeStep]:
        if variant not in self._steps:
            self._steps[variant] = {name: ComputeStep(self._context, program) for name, program in variant.programs().items()}
        return self._steps[variant]


def create() -> TileLists:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(TileLists)
