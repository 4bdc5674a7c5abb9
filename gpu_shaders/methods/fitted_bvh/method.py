"""Runs the shaders of Fitted BVH; see the package for what it does."""

from __future__ import annotations

from ....addon.fluid.balls import Balls
from ....addon.fluid.camera import Camera
from ....addon.fluid.field import Field
from ....addon.fluid.kernels import POLYNOMIAL_KERNELS
from ....addon.render.method import Attribute, Request
from ....addon.render.tree_builder import TREES, BuiltTree, TreeBuilder
from ...compute_step import ComputeStep
from ...context import GpuContext, shared_context
from ...parted_method import PartedMethod
from ...stage_times import StageTimes
from ...step import Step
from ...surface_textures import SurfaceTextures
from ...tree_buffers import TreeBuffers, uses_storage
from ...tree_camera import tree_camera_uniforms
from ...tree_constants import TreeVariant
from .params import METHOD
from .programs import Variant

_IMAGES = {"depth": 0, "normal": 1, "color": 2, "velocity": 3, "ball": 4}
"""Binding points."""


class FittedBvhMethod(PartedMethod[BuiltTree]):
    """The method on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    hierarchy
        The kind of tree, see :class:`fitted_bvh.FittedBvh`; "overlapping" is there to compare with.
    with_storage
        Whether to use compute shaders and storage buffers; None: where there are any, in hardware.
    """

    def __init__(self, context: GpuContext, hierarchy: str = "fitted", with_storage: bool | None = None) -> None:
        context.require(METHOD.gl_version, draw_buffers=len(_IMAGES))
        super().__init__(context, METHOD)
        self._hierarchy = hierarchy
        self._with_storage = uses_storage(context) if with_storage is None else with_storage
        self._steps: dict[Variant, Step | ComputeStep] = {}
        self._builder = TREES if hierarchy == "fitted" else TreeBuilder(hierarchy)
        self._tree: BuiltTree | None = None
        self._buffers: TreeBuffers | None = None
        # A driver that rejects the shaders is to be known before the method is chosen.
        context.run(lambda: self._step_of(Variant(POLYNOMIAL_KERNELS["wyvill"], TreeVariant(self._with_storage))))

    def prepare(self, balls: Balls, field: Field, threads: int) -> None:
        """See :meth:`method.PreparingMethod.prepare`."""
        if len(balls):
            self._builder.expect(balls, field, threads)

    def scene_of(self, request: Request, milliseconds: dict[str, float]) -> BuiltTree | None:
        """The tree over the balls."""
        return self._tree_of(request, milliseconds) if len(request.balls) else None

    def forget(self) -> None:
        """See :meth:`PartedMethod.forget`."""
        self._tree, self._buffers = None, None
        self._builder.forget()

    def _tree_of(self, request: Request, milliseconds: dict[str, float]) -> BuiltTree:
        """The tree over the balls, which stays while the same balls are asked for; the time that it took where it is new."""
        tree = self._builder.tree(request.balls, request.field, request.threads, request.watch)
        if tree is not self._tree:
            milliseconds["build"] = tree.seconds * 1e3
            self._tree, self._buffers = tree, None
        return tree

    def fill(self, request: Request, scene: BuiltTree, camera: Camera, textures: SurfaceTextures) -> None:
        """See :meth:`PartedMethod.fill`."""
        times = StageTimes(self._context)
        with times.of("upload"):
            buffers = self._uploaded(scene, frozenset(request.known_attributes))
        step = self._step_of(Variant(request.field.polynomial_kernel, buffers.variant, request.known_attributes))
        step.set_uniforms({**buffers.uniforms, **tree_camera_uniforms(scene.arrays, camera, request.field)})
        with times.of("cast"):
            _cast(step, buffers, textures)
        textures.add_report(times.milliseconds, {})

    def _uploaded(self, tree: BuiltTree, attributes: frozenset[Attribute]) -> TreeBuffers:
        if self._buffers is None or not self._buffers.has(attributes):
            self._buffers = None  # its memory may be needed
            overlaps = self._hierarchy == "overlapping"
            self._buffers = TreeBuffers(
                self._context, tree.arrays, tree.balls, attributes, with_storage=self._with_storage, overlaps=overlaps
            )
        return self._buffers

    def _step_of(self, variant: Variant) -> Step | ComputeStep:
        if variant not in self._steps:
            kind = ComputeStep if variant.tree.with_storage else Step
            self._steps[variant] = kind(self._context, variant.program())
        return self._steps[variant]


def create() -> FittedBvhMethod:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(FittedBvhMethod)


def _cast(step: Step | ComputeStep, buffers: TreeBuffers, textures: SurfaceTextures) -> None:
    """Cast the rays of all pixels."""
    width, height = textures.size
    if isinstance(step, ComputeStep):
        buffers.bind()
        for name, texture in textures.textures.items():
            texture.bind_to_image(_IMAGES[name], read=False, write=True)
        step.run(-(-width // 8), -(-height // 4))
    else:
        step.draw_plainly(textures.framebuffer, buffers.textures)
