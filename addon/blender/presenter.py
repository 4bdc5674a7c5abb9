"""Draws the images of a live view into a 3D viewport, through Blender's own graphics module.

Each sample is uploaded once and shaded once into a sum, in linear light of the display; every redraw brings the sum to the
screen with its depth. A change of the look shades what is already there anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import gpu
import numpy as np
import numpy.typing as npt
from gpu_extras.batch import batch_for_shader

from ...gpu_shaders.viewport.programs import SHADE, SHOW, ViewportProgram
from ..fluid.look import LOOK_STYLES, Look
from ..render.live_view import Picture
from .texture_sharing import Textures, textures_of, uploaded
from .view_transform import TABLE_SIZE, DisplayTransform

FloatArray = npt.NDArray[np.float64]

UNCHANGED = DisplayTransform()
"""For colours that stand for numbers."""

_CORNERS = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]


@dataclass(frozen=True)
class Place:
    """Where in a viewport the images belong.

    Attributes
    ----------
    projection
        (4, 4): Blender's own, OpenGL's convention.
    depth_offset
        What to add to planar depths of the images, Blender units.
    rectangle
        Left, bottom, right, top in normalized device coordinates.
    has_depth
        False where Blender has no depth of its meshes; the fluid is then in front of everything.
    """

    projection: FloatArray
    depth_offset: float
    rectangle: tuple[float, float, float, float]
    has_depth: bool = True


@dataclass
class _Sample:
    """A picture on the graphics processor."""

    picture: Picture
    textures: Textures
    importance: gpu.types.GPUTexture | None
    thickness: gpu.types.GPUTexture | None


@dataclass
class _Sum:
    """Samples that were shaded, one upon the other."""

    texture: gpu.types.GPUTexture
    framebuffer: gpu.types.GPUFrameBuffer
    count: int = 0


class Presenter:
    """Draws into one viewport. To be given up where Blender's graphics context is active, and before Blender ends."""

    def __init__(self) -> None:
        self._samples: list[_Sample] = []
        self._sum: _Sum | None = None
        self._shaded_as: tuple[Look, DisplayTransform] | None = None
        self._programs: dict[str, _Program] = {}
        self._table: tuple[DisplayTransform, gpu.types.GPUTexture] | None = None

    def draw(self, pictures: Sequence[Picture], look: Look, transform: DisplayTransform, place: Place) -> None:
        """Draw the mean of the pictures, which are samples of one view; in a draw handler.

        Blender's state of drawing is left as it was found.
        """
        if LOOK_STYLES[look.style].is_data:
            transform = UNCHANGED
        before = _State()
        try:
            self._take(pictures)
            self._shade(look, transform)
            self._show(place)
        finally:
            before.restore()

    def _take(self, pictures: Sequence[Picture]) -> None:
        """Upload what is new; samples of another view are dropped."""
        known = len(self._samples)
        if [sample.picture for sample in self._samples] != list(pictures[:known]):
            self._samples, self._shaded_as, known = [], None, 0
        self._samples += map(_uploaded_sample, pictures[known:])

    def _shade(self, look: Look, transform: DisplayTransform) -> None:
        # Transforms are equal only where they are the same.
        if self._shaded_as != (look, transform):
            self._begin_sum(self._samples[0].textures["depth"])
            self._shaded_as = look, transform
        assert self._sum is not None
        program = self._program(SHADE)
        for sample in self._samples[self._sum.count :]:
            gpu.state.blend_set("ADDITIVE_PREMULT" if self._sum.count else "NONE")
            gpu.state.depth_test_set("NONE")
            gpu.state.depth_mask_set(False)
            with self._sum.framebuffer.bind():
                program.draw(_shade_params(sample, look, transform), self._shade_textures(sample, look, transform))
            self._sum.count += 1

    def _begin_sum(self, like: gpu.types.GPUTexture) -> None:
        """The first sample overwrites what is in the texture, which is used again where it has the size."""
        if self._sum is not None and (self._sum.texture.width, self._sum.texture.height) == (like.width, like.height):
            self._sum.count = 0
            return
        texture = gpu.types.GPUTexture((like.width, like.height), format="RGBA16F")
        self._sum = _Sum(texture, gpu.types.GPUFrameBuffer(color_slots=[texture]))

    def _show(self, place: Place) -> None:
        assert self._sum is not None
        gpu.state.blend_set("ALPHA_PREMULT")
        gpu.state.depth_test_set("LESS_EQUAL" if place.has_depth else "ALWAYS")
        gpu.state.depth_mask_set(True)
        textures = {"depth_tx": self._samples[0].textures["depth"], "shaded_tx": self._sum.texture}
        self._program(SHOW).draw(_show_params(place, self._sum.count), textures)

    def _program(self, source: ViewportProgram) -> _Program:
        if source.name not in self._programs:
            self._programs[source.name] = _Program(source)
        return self._programs[source.name]

    def _shade_textures(self, sample: _Sample, look: Look, transform: DisplayTransform) -> Textures:
        # Samplers that the look does not use need some texture all the same.
        depth = sample.textures["depth"]
        values = [texture for name, texture in sample.textures.items() if name not in ("depth", "normal")]
        return {
            "depth_tx": depth,
            "normal_tx": sample.textures["normal"],
            "value_tx": values[0] if values else depth,
            "importance_tx": sample.importance or depth,
            "thickness_tx": sample.thickness or depth,
            "table_tx": self._table_texture(transform) or depth,
        }

    def _table_texture(self, transform: DisplayTransform) -> gpu.types.GPUTexture | None:
        if transform.table is None:
            return None
        if self._table is None or self._table[0] is not transform:
            self._table = transform, uploaded(transform.table)
        return self._table[1]


class _Program:
    """A program with its quad and its parameters."""

    def __init__(self, source: ViewportProgram) -> None:
        self._shader = _compiled(source)
        self._batch = batch_for_shader(self._shader, "TRI_STRIP", {"corner": _CORNERS})
        self._params: gpu.types.GPUUniformBuf | None = None
        self._numbers: npt.NDArray[np.float32] | None = None

    def draw(self, params: npt.NDArray[np.float32], textures: Textures) -> None:
        """Draw the quad; `params` (n, 4) are the vectors of the structure, matrices by columns."""
        self._upload(params)
        self._shader.bind()
        for name, texture in textures.items():
            self._shader.uniform_sampler(name, texture)
        self._shader.uniform_block("params", self._params)
        self._batch.draw(self._shader)

    def _upload(self, params: npt.NDArray[np.float32]) -> None:
        if self._numbers is not None and np.array_equal(params, self._numbers):
            return
        data = gpu.types.Buffer("FLOAT", params.size, params.reshape(-1))
        if self._params is None:
            self._params = gpu.types.GPUUniformBuf(data)
        else:
            self._params.update(data)
        self._numbers = params


def _compiled(source: ViewportProgram) -> gpu.types.GPUShader:
    info = gpu.types.GPUShaderCreateInfo()
    info.typedef_source(source.structure)
    info.uniform_buf(0, source.params, "params")
    for slot, name in enumerate(source.samplers):
        info.sampler(slot, "FLOAT_2D", name)
    info.vertex_in(0, "VEC2", "corner")
    if source.varyings:
        interface = gpu.types.GPUStageInterfaceInfo(f"meniscus_{source.name}")
        for name in source.varyings:
            interface.smooth("VEC2", name)
        info.vertex_out(interface)
    info.fragment_out(0, "VEC4", "out_color")
    # Before 4.5 a shader may write depths without saying so.
    if source.writes_depth and hasattr(info, "depth_write"):
        info.depth_write("ANY")
    stages = source.sources()
    info.vertex_source(stages["vertex"].body)
    info.fragment_source(stages["fragment"].body)
    return gpu.shader.create_from_info(info)


def _uploaded_sample(picture: Picture) -> _Sample:
    importance, thickness = (None if beside is None else uploaded(beside) for beside in (picture.importance, picture.thickness))
    return _Sample(picture, textures_of(picture.image), importance, thickness)


class _State:
    """What of Blender's state of drawing is changed here."""

    def __init__(self) -> None:
        self._blend, self._test = gpu.state.blend_get(), gpu.state.depth_test_get()
        self._mask = gpu.state.depth_mask_get()

    def restore(self) -> None:
        gpu.state.blend_set(self._blend)
        gpu.state.depth_test_set(self._test)
        gpu.state.depth_mask_set(self._mask)


def _shade_params(sample: _Sample, look: Look, transform: DisplayTransform) -> npt.NDArray[np.float32]:
    """(12, 4): shade_params.glsl."""
    picture, camera = sample.picture, sample.picture.image.camera
    window = camera.window
    vectors = [
        *camera.world_from_view.T,
        (window.left, window.bottom, window.right, window.top),
        (*look.light_direction, look.light_strength),
        (look.absorption, look.ior, look.metallic, look.depth_contrast if sample.importance is not None else 0.0),
        (*look.color, float("color" in sample.textures)),
        (*picture.depth_range, *(look.speed_range or picture.speed_range)),
        (look.ambient, look.roughness, list(LOOK_STYLES).index(look.style), float(camera.is_perspective)),
        (
            2**transform.exposure,
            1 / transform.gamma,
            0 if transform.table is None else TABLE_SIZE,
            float(sample.thickness is not None),
        ),
    ]
    return np.array(vectors, np.float32)


def _show_params(place: Place, count: int) -> npt.NDArray[np.float32]:
    """(3, 4): show_params.glsl. The offset of depths is in the projection."""
    (z_scale, z_shift), (w_scale, w_shift) = place.projection[2:, 2:]
    offset = place.depth_offset
    projection = (z_scale, z_shift - z_scale * offset, w_scale, w_shift - w_scale * offset)
    return np.array([place.rectangle, projection, (1.0 / count, 0, 0, 0)], np.float32)
