"""One image, or a slab of it, from the balls to the textures."""

from __future__ import annotations

import moderngl

from ....addon.fluid.camera import Camera
from ....addon.fluid.field import Field
from ...camera_parts import camera_uniforms
from ...compute_step import ComputeStep
from ...context import GpuContext
from ...stage_times import StageTimes
from ...surface_textures import SurfaceTextures
from .balls import BallBuffers, kernel_shares, least_x
from .memory import FILL_GROUPS_OFFSET, LONG_GROUPS_OFFSET, LONGEST_GROUPS_OFFSET, Memory
from .programs import TEAM, THREADS
from .slabs import Slab

_IMAGES = {"depth": 0, "normal": 1, "color": 2, "velocity": 3, "ball": 4}
"""Binding points."""

_SAMPLE = 16
"""One of so many balls is drawn before all others, where it is not known which were seen in the frame before."""

_LEAST_HIDDEN = 4
"""Those are drawn first where they are at most one of so many."""

_MOST_TRIES = 4


class Frame:
    """Finds the surface in an image; made and used on the context's thread."""

    def __init__(
        self, context: GpuContext, steps: dict[str, ComputeStep], memory: Memory, camera: Camera, field: Field
    ) -> None:
        self._context, self._steps, self._memory, self._camera, self._field = context, steps, memory, camera, field
        self._shares = memory.storage.of(kernel_shares(field))
        uniforms = {
            **camera_uniforms(camera),
            "list_count": memory.grid.tile_count,
            "isovalue": field.threshold,
            "eye": tuple(camera.eye.tolist()),
            # By columns, as OpenGL has it: of the transposed rotation.
            "view_from_world": tuple(camera.world_from_view[:3, :3].ravel().tolist()),
        }
        self._set_uniforms(uniforms)

    def find(self, balls: BallBuffers, slab: Slab, textures: SurfaceTextures) -> bool:
        """Fill the textures where the surface lies in the slab; False where its balls do not fit into the buffers at once."""
        least = self._memory.storage.of(least_x(self._field, balls.greatest_weight))
        self._set_uniforms(
            {
                "ball_count": len(balls.balls),
                "weight_of_all": balls.balls.weight or 0.0,
                "slab": (slab.start, slab.end),
                "goes_on": not slab.is_first,
            }
        )
        for _ in range(_MOST_TRIES):
            times = StageTimes(self._context)
            self._begin({**balls.buffers, 4: self._shares, 12: least})
            self._make_lists(len(balls.balls), times)
            self._cast(textures, times)
            seen, entries, crowded, longest = self._memory.read_counts()
            if self._memory.holds(seen, entries):
                self._memory.know(seen, len(balls.balls))
                break
            if not self._memory.grow(seen, entries):
                return False
        else:
            return False
        counts = {"balls_drawn": seen, "entries": entries, "longest_list": longest, "crowded_rays": crowded}
        textures.add_report(times.milliseconds, counts)
        return True

    def _set_uniforms(self, values: dict[str, object]) -> None:
        for step in self._steps.values():
            step.set_uniforms(values)

    def _begin(self, buffers: dict[int, moderngl.Buffer]) -> None:
        """Bind all buffers, and forget what was in them before."""
        memory = self._memory
        self._set_uniforms({"seen_capacity": memory.seen_capacity, "entry_capacity": memory.entry_capacity})
        memory.begin()
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)

    def _make_lists(self, count: int, times: StageTimes) -> None:
        memory, steps = self._memory, self._steps
        with times.of("occlude"):
            known = memory.known_among(count)
            if 0 < known <= count // _LEAST_HIDDEN:
                self._occlude(0, known)
            else:
                self._occlude(_SAMPLE, -(-count // _SAMPLE))
            self._occlude(1, count)
        with times.of("cull"):
            steps["cull"].run_in_lines(-(-count // THREADS))
        with times.of("bin"):
            steps["allot"].run_in_lines(-(-memory.grid.tile_count // THREADS))
            steps["fill"].run_indirect(memory.counts, FILL_GROUPS_OFFSET)
        with times.of("sort"):
            if "sort_serial" in steps:
                steps["sort_serial"].run_in_lines(-(-memory.grid.tile_count // THREADS))
            else:
                steps["sort_short"].run_in_lines(-(-memory.grid.tile_count * TEAM // THREADS))
            steps["sort_long"].run_indirect(memory.counts, LONG_GROUPS_OFFSET)
            steps["sort_longest"].run_indirect(memory.counts, LONGEST_GROUPS_OFFSET)

    def _occlude(self, step_size: int, count: int) -> None:
        """Draw `count` kernel spheres, see `step_size` of occlude.comp, and make the pyramid of what they hide."""
        steps, grid = self._steps, self._memory.grid
        self._memory.forget_large()
        steps["occlude"].set_uniforms({"step_size": step_size, "drawn_count": count, "is_first": step_size != 1})
        steps["occlude"].run_in_lines(-(-count // THREADS))
        steps["occlude_large"].run_indirect(self._memory.large, 0)
        for level in range(0, grid.levels, 4):
            steps["pyramid"].set_uniforms({"base_level": level})
            columns, rows = (-(-side // 2**level) for side in grid.cells)
            steps["pyramid"].run(-(-columns // 16), -(-rows // 16))

    def _cast(self, textures: SurfaceTextures, times: StageTimes) -> None:
        for name, texture in textures.textures.items():
            texture.bind_to_image(_IMAGES[name], read=name in ("depth", "normal"), write=True)
        with times.of("cast"):
            self._steps["cast"].run(-(-self._camera.width // 8), -(-self._camera.height // 4))
