"""Runs the shaders of Depth Peeling; see the package for what it does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache, partial

import moderngl
import numpy as np
import numpy.typing as npt

from ....addon.fluid.camera import Camera, Region
from ....addon.fluid.errors import InputError
from ....addon.fluid.field import Field
from ....addon.fluid.kernels import Kernel
from ....addon.fluid.passes import DEPTH_BACKGROUND
from ....addon.fluid.view_balls import ViewBalls, view_balls
from ....addon.render.method import Request, Surface, timed
from ...context import GpuContext, shared_context
from .params import MAX_BALLS, METHOD

_FOLDER = "methods/depth_peeling"
_BALL_TEXTURE_WIDTH = 4096
# N_buf render targets of four words hold the state, which takes two, and 4 N_buf - 2 = 14 ids, as in the paper.
_LIST_TARGETS = 4
LIST_LENGTH = 4 * _LIST_TARGETS - 2
# As in state.glsl.
_STATE_OVERFLOW = 4
# A band of rows of this many pixels takes some 250 MB.
_PIXELS_PER_BAND = 2**20


class DepthPeeling:
    """The method on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    list_length
        Balls that a ray may be in before its pixel is done again without a list, 1 to 14.
    """

    def __init__(self, context: GpuContext, list_length: int = LIST_LENGTH) -> None:
        context.require(METHOD.gl_version)
        self._context = context
        self._list_length = list_length
        self._targets: _Targets | None = None

    @property
    def device(self) -> str:
        """What the driver calls the graphics processor."""
        return str(self._context.renderer)

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        milliseconds: dict[str, float] = {}
        with timed(milliseconds, "view"):
            balls = view_balls(request.balls, request.camera, request.field)
        if len(balls) > MAX_BALLS:
            raise InputError(
                f"{len(balls)} balls meet the view but {METHOD.label} takes at most {MAX_BALLS}; "
                "show fewer, or choose another method"
            )
        surface = _empty(request.camera, "color" in request.attributes and balls.colors is not None)
        surface.counts = {"balls_drawn": len(balls), "peels": 0, "overflows": 0}
        with timed(milliseconds, "surface"):
            if len(balls):
                self._context.run(lambda: self._draw(balls, request, surface))
        surface.milliseconds = milliseconds
        return surface

    def _draw(self, balls: ViewBalls, request: Request, surface: Surface) -> None:
        """Fill `surface` band by band; on the context's thread."""
        camera, field = request.camera, request.field
        colors = balls.colors if surface.color is not None else None
        textures = _ball_textures(self._context.gl, balls, colors)
        constants = {
            "BALL_TEXTURE_WIDTH": _BALL_TEXTURE_WIDTH,
            "LIST_LENGTH": self._list_length,
            "WITH_COLORS": int(colors is not None),
            **kernel_constants(field.density_kernel),
        }
        for band in _bands(camera):
            part = replace(camera, region=band).cropped()
            check_cancelled = partial(request.watch, band.y_min / camera.height)
            frame = _Frame(self._context, self._targets_for(part), constants, len(balls), check_cancelled)
            frame.bind(textures, _uniforms(balls, part, field))
            counts = frame.peel_all()
            rows = slice(band.y_min, band.y_max)
            normal_depth = frame.read(0)
            surface.normal[rows] = normal_depth[..., :3]
            surface.depth[rows] = np.minimum(normal_depth[..., 3], DEPTH_BACKGROUND)
            if surface.color is not None:
                surface.color[rows] = frame.read(1)[..., :3]
            for name, count in counts.items():
                surface.counts[name] += count

    def _targets_for(self, camera: Camera) -> _Targets:
        """The render targets of the camera's size, kept from band to band and frame to frame."""
        size = (camera.width, camera.height)
        if self._targets is None or self._targets.size != size:
            self._targets = _Targets(self._context, size)
        return self._targets


def create() -> DepthPeeling:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return _on(shared_context())


@lru_cache(maxsize=1)
def _on(context: GpuContext) -> DepthPeeling:
    """One that keeps its render targets, until the process gets another context."""
    return DepthPeeling(context)


def _empty(camera: Camera, with_color: bool) -> Surface:
    """The surface of nothing, to be filled."""
    shape = (camera.height, camera.width)
    color = np.zeros((*shape, 3), np.float32) if with_color else None
    return Surface(np.full(shape, DEPTH_BACKGROUND, np.float32), np.zeros((*shape, 3), np.float32), color)


def kernel_constants(kernel: Kernel) -> dict[str, object]:
    """The kernel as lib/kernel.glsl wants it: ``x^power (low + high x)``."""
    power = {1: 1, 2: 2, 3: 2, 4: 4}[len(kernel.coefficients) - 1]
    low, high = (*kernel.coefficients, 0.0)[power : power + 2]
    return {
        "KERNEL_DEGREE": kernel.ray_degree,
        "KERNEL_POWER": power,
        "KERNEL_LOW": f"float({low!r})",
        "KERNEL_HIGH": f"float({high!r})",
    }


def _bands(camera: Camera) -> Iterator[Region]:
    rows = max(1, _PIXELS_PER_BAND // camera.width)
    for begin in range(0, camera.height, rows):
        yield Region(0, begin, camera.width, min(begin + rows, camera.height))


def _ball_textures(
    gl: moderngl.Context, balls: ViewBalls, colors: npt.NDArray[np.float32] | None
) -> dict[str, moderngl.Texture]:
    """The balls as float textures, by sampler name."""
    arrays = {
        "sphere_tx": np.column_stack([balls.centers, balls.radii]).astype(np.float32),
        "density_tx": np.column_stack([balls.weights, balls.kernel_radii]).astype(np.float32),
    }
    if colors is not None:
        arrays["color_tx"] = np.column_stack([colors, np.ones(len(colors), np.float32)])
    return {name: _texture_of_rows(gl, array) for name, array in arrays.items()}


def _texture_of_rows(gl: moderngl.Context, rows: npt.NDArray[np.float32]) -> moderngl.Texture:
    """(M, components) as a texture with one texel a row, left to right and on the next line after BALL_TEXTURE_WIDTH."""
    lines = -(-len(rows) // _BALL_TEXTURE_WIDTH)
    padded = np.zeros((lines * _BALL_TEXTURE_WIDTH, rows.shape[1]), np.float32)
    padded[: len(rows)] = rows
    texture = gl.texture((_BALL_TEXTURE_WIDTH, lines), rows.shape[1], padded, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def _uniforms(balls: ViewBalls, camera: Camera, field: Field) -> dict[str, object]:
    """What the shaders of lib/ and this method share."""
    window = camera.window
    farthest = float(np.max(np.linalg.norm(balls.centers, axis=1) + balls.radii))
    farthest = max(farthest, camera.clip_start * float(np.hypot.reduce([1.0, *_corner(camera)])))
    return {
        "window_middle": ((window.left + window.right) / 2, (window.bottom + window.top) / 2),
        "pixel_size": camera.pixel_size,
        "image_middle": (camera.width / 2, camera.height / 2),
        "is_perspective": camera.is_perspective,
        "isovalue": field.isovalue,
        "clip_distances": (camera.clip_start, camera.clip_end),
        # A power of two, so that scaling loses nothing; below 1/2, so that nothing comes near the cleared depth of 1.
        "depth_scale": 2.0 ** -(np.ceil(np.log2(farthest)) + 1),
        "world_from_view": tuple(camera.world_from_view[:3, :3].T.ravel()),
    }


def _corner(camera: Camera) -> tuple[float, float]:
    """The slope of the steepest ray."""
    if not camera.is_perspective:
        return 0.0, 0.0
    window = camera.window
    return max(abs(window.left), abs(window.right)), max(abs(window.bottom), abs(window.top))


def _bounding_box(mask: npt.NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """x, y, width and height of the least box around the pixels of a mask that has some."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1] - columns[0]) + 1, int(rows[-1] - rows[0]) + 1


class _Targets:
    """The images that are drawn into, two of each that is read while its successor is written."""

    def __init__(self, context: GpuContext, size: tuple[int, int]) -> None:
        gl = context.gl
        self.size = size
        self.crossing = gl.texture(size, 1, dtype="u4")
        self.depths = [context.depth_texture(size) for _ in range(2)]
        self.lists = [[gl.texture(size, 4, dtype="u4") for _ in range(_LIST_TARGETS)] for _ in range(2)]
        self.sums = [gl.texture(size, 4, dtype="f4") for _ in range(3)]
        self.outputs = [gl.texture(size, 4, dtype="f4") for _ in range(2)]
        self.peel = [gl.framebuffer([self.crossing], depth) for depth in self.depths]
        self.whole_list = [gl.framebuffer(targets, depth) for targets, depth in zip(self.lists, self.depths, strict=True)]
        self.state_only = [gl.framebuffer(targets[:1], depth) for targets, depth in zip(self.lists, self.depths, strict=True)]
        self.sum = gl.framebuffer(self.sums)
        self.gather = gl.framebuffer(self.sums[:2])
        self.finish = gl.framebuffer(self.outputs)
        for texture in [self.crossing, *self.lists[0], *self.lists[1], *self.sums, *self.outputs]:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    @contextmanager
    def spheres_only_within(self, box: tuple[int, int, int, int]) -> Iterator[None]:
        """Peel and sum only in a box of pixels (x, y, width, height)."""
        framebuffers = [*self.peel, self.sum]
        for framebuffer in framebuffers:
            framebuffer.scissor = box
        try:
            yield
        finally:
            for framebuffer in framebuffers:
                framebuffer.scissor = (0, 0, *self.size)


class _Frame:
    """One band of an image on its way through the shaders."""

    def __init__(
        self,
        context: GpuContext,
        targets: _Targets,
        constants: dict[str, object],
        ball_count: int,
        check_cancelled: Callable[[], None],
    ) -> None:
        self._gl = context.gl
        self._targets = targets
        self._ball_count = ball_count
        self._check_cancelled = check_cancelled
        # Which of each pair of targets holds the present state.
        self._now = 0
        self._query = self._gl.query(samples=True)
        self._steps = {
            "begin": _Step(context, "screen", "begin", constants),
            "begin_again": _Step(context, "screen", "begin", {**constants, "AGAIN": 1}),
            **{name: _Step(context, "sphere", name, constants) for name in ("peel", "sum", "gather")},
            **{name: _Step(context, "screen", name, constants) for name in ("search_list", "search_sum", "finish")},
        }

    def bind(self, textures: dict[str, moderngl.Texture], uniforms: dict[str, object]) -> None:
        """Give every step the balls and the camera."""
        for step in self._steps.values():
            step.set_uniforms(uniforms)
            step.textures.update(textures)

    def peel_all(self) -> dict[str, int]:
        """Peel until no ray has a crossing left; overflowed pixels once more without a list; then gather the gradient."""
        self._gl.disable(moderngl.BLEND | moderngl.CULL_FACE)
        self._over_screen("begin", self._targets.whole_list[0])
        peels = self._peel("search_list", self._targets.whole_list, sums=False)
        overflowed = self._overflowed()
        if overflowed.any():
            self._over_screen("begin_again", self._targets.state_only[1 - self._now], state_tx=self._state())
            self._now = 1 - self._now
            # Often it is a handful of pixels: spheres elsewhere need not be drawn.
            with self._targets.spheres_only_within(_bounding_box(overflowed)):
                peels += self._peel("search_sum", self._targets.state_only, sums=True)
        self._gather()
        return {"peels": peels, "overflows": int(np.count_nonzero(overflowed))}

    def _state(self) -> moderngl.Texture:
        return self._targets.lists[self._now][0]

    def _peel(self, search: str, framebuffers: Sequence[moderngl.Framebuffer], sums: bool) -> int:
        """Peel and search until nothing is left to peel; how often."""
        targets = self._targets
        for peel in range(2 * self._ball_count + 1):
            self._check_cancelled()
            with self._query:
                self._over_balls("peel", targets.peel[self._now], moderngl.DEPTH_TEST, state_tx=self._state())
            if not self._query.samples:
                return peel
            read = {"state_tx": self._state(), "depth_tx": targets.depths[self._now], "crossing_tx": targets.crossing}
            if sums:
                targets.sum.clear()
                self._over_balls("sum", targets.sum, moderngl.BLEND, state_tx=read["state_tx"], depth_tx=read["depth_tx"])
                read.update({f"density_{index}_tx": texture for index, texture in enumerate(targets.sums)})
            else:
                read.update({f"list_{index}_tx": targets.lists[self._now][index] for index in range(1, _LIST_TARGETS)})
            self._over_screen(search, framebuffers[1 - self._now], **read)
            self._now = 1 - self._now
        return 2 * self._ball_count + 1

    def _overflowed(self) -> npt.NDArray[np.bool_]:
        """(height, width): the pixels whose list was too short."""
        width, height = self._targets.size
        words = np.frombuffer(self._state().read(), np.uint32).reshape(height, width, 4)[..., 0]
        overflowed: npt.NDArray[np.bool_] = words & 7 == _STATE_OVERFLOW
        return overflowed

    def _gather(self) -> None:
        targets = self._targets
        targets.gather.clear()
        self._over_balls("gather", targets.gather, moderngl.BLEND, state_tx=self._state())
        read = {"state_tx": self._state(), "gradient_tx": targets.sums[0], "color_sum_tx": targets.sums[1]}
        self._over_screen("finish", targets.finish, **read)

    def read(self, output: int) -> npt.NDArray[np.float32]:
        """(height, width, 4): an output of finish.frag."""
        width, height = self._targets.size
        return np.frombuffer(self._targets.outputs[output].read(), np.float32).reshape(height, width, 4)

    def _over_screen(self, step: str, framebuffer: moderngl.Framebuffer, **textures: moderngl.Texture) -> None:
        # The depth buffer is written, never asked.
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "1"
        self._steps[step].draw(framebuffer, 3, textures)

    def _over_balls(self, step: str, framebuffer: moderngl.Framebuffer, flags: int, **textures: moderngl.Texture) -> None:
        self._gl.enable_only(flags)
        self._gl.depth_func = "<"
        self._gl.blend_func = moderngl.ONE, moderngl.ONE
        self._steps[step].draw(framebuffer, 6 * self._ball_count, textures)


class _Step:
    """A program of this method, and what it reads."""

    def __init__(self, context: GpuContext, vertex: str, fragment: str, constants: dict[str, object]) -> None:
        self._program = context.program(f"{_FOLDER}/{vertex}.vert", f"{_FOLDER}/{fragment}.frag", constants)
        self._vertices = context.gl.vertex_array(self._program, [])
        self.textures: dict[str, moderngl.Texture] = {}

    def set_uniforms(self, values: dict[str, object]) -> None:
        """Set those of `values` that the program uses."""
        for name, value in values.items():
            if name in self._program:
                self._program[name] = value

    def draw(self, framebuffer: moderngl.Framebuffer, vertices: int, textures: dict[str, moderngl.Texture]) -> None:
        """Draw triangles into `framebuffer`, reading `textures` and the step's own."""
        used = [name for name in (*self.textures, *textures) if name in self._program]
        for unit, name in enumerate(used):
            (textures.get(name) or self.textures[name]).use(unit)
            self._program[name] = unit
        framebuffer.use()
        self._vertices.render(moderngl.TRIANGLES, vertices)
