"""Traces the light of a surface that a method has left on the graphics processor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from ...addon.fluid.balls import Balls
from ...addon.fluid.camera import Camera
from ...addon.fluid.field import Field
from ...addon.fluid.lighting import Light, Lighting, Material
from ...addon.fluid.meshes import Meshes
from ...addon.fluid.tracing import Tracing
from ...addon.render.fitted_bvh import TreeArrays
from ...addon.render.method import Attribute
from ..buffer_texture import BufferTexture, Numbers, Texels
from ..compute_step import ComputeStep
from ..context import GpuContext
from ..stage_times import StageTimes
from ..step import Step, Texture
from ..storage import Storage
from ..surface_textures import SurfaceTextures
from ..tree_buffers import TreeBuffers, uses_storage
from ..tree_camera import tree_camera_uniforms
from .programs import Variant

_KINDS = {"SUN": 0, "POINT": 1, "SPOT": 2, "AREA": 3}
_SCENE_BINDING = 6

# Where each part is bound, and what its texels are.
_PARTS: dict[str, tuple[int, Texels]] = {"sources": (7, "i1"), "triangle_nodes": (8, "u4"), "triangles": (9, "f4")}

_MOST_DISTANCE = 3e38
"""Stands for no end in shaders."""


@dataclass(frozen=True)
class TracedMeshes:
    """Meshes that light meets beside the fluid.

    Attributes
    ----------
    meshes
        The triangles, and what they are made of.
    nodes, ids
        (M, 8) float32 and (K,) uint32: the tree over them, as the native core gives it; world space.
    """

    meshes: Meshes
    nodes: npt.NDArray[np.float32]
    ids: npt.NDArray[np.uint32]


@dataclass(frozen=True)
class TracedFluid:
    """What light meets.

    Attributes
    ----------
    tree, balls, field
        The tree over the balls; its origin is that of scene coordinates.
    materials
        Of the balls' sources; their colours count where the balls have none.
    meshes
        What else there is; None for nothing.
    """

    tree: TreeArrays
    balls: Balls
    field: Field
    materials: tuple[Material, ...]
    meshes: TracedMeshes | None = None

    @property
    def all_materials(self) -> tuple[Material, ...]:
        """Those of the balls, and behind them those of the meshes."""
        return self.materials + (self.meshes.meshes.materials if self.meshes is not None else ())


class TracedLight:
    """Traces light on one OpenGL context; use it within :meth:`GpuContext.run`.

    Parameters
    ----------
    context
        Where to run.
    with_storage
        Whether to use compute shaders and storage buffers; None: where there are any, in hardware.
    """

    def __init__(self, context: GpuContext, with_storage: bool | None = None) -> None:
        self._context = context
        self._with_storage = uses_storage(context) if with_storage is None else with_storage
        self._steps: dict[Variant, Step | ComputeStep] = {}
        self._fluid: TracedFluid | None = None
        self._buffers: TreeBuffers | None = None
        self._further: dict[str, BufferTexture | moderngl.Buffer] = {}
        self._world: tuple[object, dict[str, moderngl.Texture]] = (None, {})

    def trace(
        self,
        surface: SurfaceTextures,
        camera: Camera,
        fluid: TracedFluid,
        lighting: Lighting,
        tracing: Tracing,
        irradiance: npt.NDArray[np.float32] | None = None,
        first_sample: int = 0,
        is_film_clear: bool = False,
    ) -> moderngl.Texture:
        """The light that a surface sends to the eye.

        Parameters
        ----------
        surface, camera
            What the image shows, whatever method has found it, and from where; the camera has no region.
        fluid, lighting, tracing
            What light meets, in world space, and how far it is followed.
        irradiance
            (h, w, 3) the irradiance over pi by normals, equirectangular, where the world has an image.
        first_sample
            How many samples of this view were taken before: each is another one.
        is_film_clear
            Whether the world that is seen straight through surfaces is left out, and makes the image transparent.

        Returns
        -------
        (height, width, 4) float32: linear Rec.709, premultiplied; 0 where there is no surface.
        """
        gl = self._context.gl
        buffers = self._uploaded(fluid)
        balls, materials = fluid.balls, fluid.all_materials
        lets_pass = any(material.transmission > 0 and material.metallic < 1 for material in materials)
        with_image = lighting.image is not None and irradiance is not None
        variant = Variant(
            fluid.field.polynomial_kernel,
            buffers.variant,
            balls.colors is not None,
            balls.sources is not None,
            lets_pass,
            with_image,
            fluid.meshes is not None,
        )
        step = self._step_of(variant)
        step.set_uniforms(
            {
                **buffers.uniforms,
                **tree_camera_uniforms(fluid.tree, camera, fluid.field),
                **_uniforms(fluid, lighting, tracing, first_sample, is_film_clear),
            }
        )
        texels = scene_texels(materials, lighting, fluid.tree.origin)
        worlds = self._world_textures(lighting, irradiance) if with_image else {}
        output = gl.texture(surface.size, 4, dtype="f4")
        times = StageTimes(self._context)
        with times.of("trace"):
            if isinstance(step, ComputeStep):
                self._compute(step, buffers, texels, worlds, surface, output)
            else:
                self._draw(step, buffers, texels, worlds, surface, output)
        surface.add_report(times.milliseconds, {})
        return output

    def _compute(
        self,
        step: ComputeStep,
        buffers: TreeBuffers,
        texels: npt.NDArray[np.float32],
        worlds: dict[str, moderngl.Texture],
        surface: SurfaceTextures,
        output: moderngl.Texture,
    ) -> None:
        buffers.bind()
        Storage(self._context).of(texels).bind_to_storage_buffer(_SCENE_BINDING)
        for name, buffer in self._further.items():
            assert isinstance(buffer, moderngl.Buffer)
            buffer.bind_to_storage_buffer(_PARTS[name][0])
        surface.textures["depth"].bind_to_image(0, read=True, write=False)
        surface.textures["normal"].bind_to_image(1, read=True, write=False)
        output.bind_to_image(2, read=False, write=True)
        step.use_textures(worlds)
        width, height = surface.size
        step.run(-(-width // 8), -(-height // 4))

    def _draw(
        self,
        step: Step,
        buffers: TreeBuffers,
        texels: npt.NDArray[np.float32],
        worlds: dict[str, moderngl.Texture],
        surface: SurfaceTextures,
        output: moderngl.Texture,
    ) -> None:
        textures: dict[str, Texture] = {
            **buffers.textures,
            **worlds,
            "scene_tx": BufferTexture.of(self._context, "f4", texels),
            "depth_tx": surface.textures["depth"],
            "normal_tx": surface.textures["normal"],
        }
        for name, texture in self._further.items():
            assert isinstance(texture, BufferTexture)
            textures[f"{name}_tx"] = texture
        step.draw_plainly(self._context.gl.framebuffer([output]), textures)

    def _uploaded(self, fluid: TracedFluid) -> TreeBuffers:
        """The trees' buffers, which stay while the same trees are asked for."""
        known = self._fluid
        if self._buffers is None or known is None or known.tree is not fluid.tree or known.meshes is not fluid.meshes:
            self._buffers, self._further = None, {}  # their memory may be needed
            names: list[Attribute] = ["color"] if fluid.balls.colors is not None else []
            names += ["ball"] if fluid.balls.sources is not None else []
            attributes = frozenset(names)
            self._buffers = TreeBuffers(self._context, fluid.tree, fluid.balls, attributes, with_storage=self._with_storage)
            storage = Storage(self._context)
            for name, array in _further_parts(fluid):
                texels = _PARTS[name][1]
                self._further[name] = (
                    storage.of(array) if self._with_storage else BufferTexture.of(self._context, texels, array)
                )
            self._fluid = fluid
        return self._buffers

    def _world_textures(self, lighting: Lighting, irradiance: npt.NDArray[np.float32] | None) -> dict[str, moderngl.Texture]:
        """The world's images, which stay while the same one is asked for."""
        if self._world[0] is not lighting.image:
            images = {"world_tx": lighting.image.pixels if lighting.image else None, "irradiance_tx": irradiance}
            textures = {name: _image_texture(self._context, image) for name, image in images.items() if image is not None}
            self._world = lighting.image, textures
        return self._world[1]

    def _step_of(self, variant: Variant) -> Step | ComputeStep:
        if variant not in self._steps:
            kind = ComputeStep if variant.tree.with_storage else Step
            self._steps[variant] = kind(self._context, variant.program())
        return self._steps[variant]


def _further_parts(fluid: TracedFluid) -> Iterator[tuple[str, Numbers]]:
    """What there is beside the tree over the balls, by name."""
    if fluid.balls.sources is not None:
        yield "sources", fluid.balls.sources
    if fluid.meshes is not None:
        yield "triangle_nodes", _moved_nodes(fluid.meshes.nodes, fluid.tree.origin)
        yield "triangles", _triangle_texels(fluid.meshes, fluid.tree.origin, len(fluid.materials))


def _moved_nodes(nodes: npt.NDArray[np.float32], origin: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    """Boxes in scene coordinates, larger by what is rounded."""
    moved = nodes.copy()
    for columns, side in ((slice(0, 3), -np.inf), (slice(4, 7), np.inf)):
        moved[:, columns] = np.nextafter((nodes[:, columns] - origin).astype(np.float32), np.float32(side))
    return moved


def _triangle_texels(traced: TracedMeshes, origin: npt.NDArray[np.float64], first_material: int) -> npt.NDArray[np.float32]:
    """(K, 6, 4): corners and normals of the triangles of the leaves, in scene coordinates, and the materials."""
    meshes = traced.meshes
    # Between leaves there are gaps, which nobody reads.
    ids = np.minimum(traced.ids, len(meshes.triangles) - 1)
    texels = np.zeros((len(ids), 6, 4), np.float32)
    texels[:, :3, :3] = meshes.vertices[meshes.triangles[ids]] - origin
    texels[:, 0, 3] = meshes.material[ids] + first_material
    texels[:, 3:, :3] = meshes.normals[ids]
    return texels


def scene_texels(
    materials: tuple[Material, ...], lighting: Lighting, origin: npt.NDArray[np.float64]
) -> npt.NDArray[np.float32]:
    """(K, 4): materials and lights as lib/light.glsl reads them, in scene coordinates."""
    numbers = [number for material in materials for number in _material_numbers(material)]
    numbers += [number for light in lighting.lights for number in _light_numbers(light, origin)]
    return np.array(numbers, np.float32).reshape(-1, 4)


def _material_numbers(material: Material) -> list[float]:
    color, emission, absorption = material.color, material.emission, material.absorption
    return [
        *(*color, material.metallic),
        *(*emission, material.roughness),
        *(*absorption, material.transmission),
        *(material.ior, 0.0, 0.0, 0.0),
    ]


def _light_numbers(light: Light, origin: npt.NDArray[np.float64]) -> list[float]:
    position = (np.array(light.position, np.float64) - origin).tolist()
    return [
        *(*position, float(_KINDS[light.kind])),
        *(*light.direction, light.radius),
        *(*light.power, light.area),
        *(*light.cone, *light.size),
        *(*light.right, float(light.is_round + 2 * light.casts_shadow)),
    ]


def _uniforms(
    fluid: TracedFluid, lighting: Lighting, tracing: Tracing, first_sample: int, is_film_clear: bool
) -> dict[str, object]:
    radii = fluid.balls.radii
    uniforms: dict[str, object] = {
        "material_count": len(fluid.all_materials),
        "light_count": len(lighting.lights),
        "world_color": lighting.world,
        "radius_range": (float(radii.min()), float(radii.max())),
        "most_reflections": tracing.reflections,
        "most_refractions": tracing.refractions,
        "occlusion_count": tracing.occlusion_rays,
        "occlusion_distance": min(tracing.occlusion_distance, _MOST_DISTANCE),
        "has_shadows": tracing.shadows,
        "is_film_clear": is_film_clear,
        "sample_count": tracing.samples,
        "first_sample": first_sample & 0xFFFFFFFF,
    }
    if lighting.image is not None:
        turn = np.array(lighting.image.image_from_world, np.float64)
        uniforms["image_from_world"] = tuple(turn.T.ravel().tolist())
    return uniforms


def _image_texture(context: GpuContext, pixels: npt.NDArray[np.float32]) -> moderngl.Texture:
    height, width = pixels.shape[:2]
    texture = context.gl.texture((width, height), 3, np.ascontiguousarray(pixels, np.float32), dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture
