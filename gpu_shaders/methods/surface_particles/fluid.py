"""The balls and their spatial hash as shaders read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from ....addon.fluid.balls import Balls
from ....addon.fluid.errors import DeviceError
from ....addon.fluid.field import Field
from ....addon.render.surface_particles import HashLevel
from ...context import GpuContext
from ...programs import ROW_TEXTURE_WIDTH
from ...row_texture import Rows, row_texture


@dataclass(frozen=True)
class FluidArrays:
    """What fluid.glsl reads, ready to upload.

    Attributes
    ----------
    rows
        By sampler name.
    field
        Kernel and threshold.
    anchor
        (3,) float64, world space: where positions count from.
    radii
        The least and the greatest influence radius, Blender units.
    """

    rows: dict[str, Rows]
    field: Field
    anchor: npt.NDArray[np.float64]
    radii: tuple[float, float]

    @classmethod
    def of(cls, balls: Balls, field: Field, levels: Sequence[HashLevel], anchor: npt.NDArray[np.float64]) -> FluidArrays:
        """Of balls whose positions count from the anchor."""
        velocities = np.zeros((len(balls), 3), np.float32) if balls.velocities is None else balls.velocities
        rows: dict[str, Rows] = {
            "level_tx": _level_rows(levels),
            "start_tx": np.concatenate([level.starts for level in levels] or [np.zeros(1, np.uint32)])[:, None],
            "entry_tx": np.concatenate([level.entries for level in levels] or [np.zeros((1, 2), np.uint32)]),
            "ball_tx": np.column_stack([balls.positions, balls.radii]).astype(np.float32),
            "motion_tx": np.column_stack([velocities, balls.weights]).astype(np.float32),
        }
        radii = float(np.min(balls.radii, initial=np.inf)), float(np.max(balls.radii, initial=0.0))
        return cls(rows, field, anchor, radii)

    def upload(self, context: GpuContext) -> FluidTextures:
        """On the context's thread; DeviceError where the balls are in more cells than a texture holds."""
        most = context.limits.texture_size * ROW_TEXTURE_WIDTH
        count = len(self.rows["entry_tx"])
        if count > most:
            raise DeviceError(
                f"The balls are in {count} cells of the spatial hash but {context.renderer} takes at most {most}; "
                "raise the cell size, or show fewer balls"
            )
        textures = {name: row_texture(context.gl, rows) for name, rows in self.rows.items() if name != "level_tx"}
        levels = self.rows["level_tx"]
        textures["level_tx"] = context.gl.texture((len(levels), 1), 4, levels, dtype="u4")
        textures["level_tx"].filter = (moderngl.NEAREST, moderngl.NEAREST)
        return FluidTextures(textures, self.field, self.anchor, self.radii)


@dataclass(frozen=True)
class FluidTextures:
    """The fluid of a frame in the memory of the graphics processor; see :class:`FluidArrays`."""

    textures: dict[str, moderngl.Texture]
    field: Field
    anchor: npt.NDArray[np.float64]

    radii: tuple[float, float]

    @property
    def uniforms(self) -> dict[str, object]:
        """What shaders ask of it."""
        return {"isovalue": self.field.threshold}


def _level_rows(levels: Sequence[HashLevel]) -> npt.NDArray[np.uint32]:
    """(L, 4), see fluid.glsl; one that is empty where there is none."""
    sides = np.array([level.side for level in levels], np.float32).view(np.uint32)
    buckets = np.array([len(level.starts) - 1 for level in levels], np.int64)
    entries = np.array([len(level.entries) for level in levels], np.int64)
    firsts = np.cumsum(buckets + 1) - (buckets + 1), np.cumsum(entries) - entries
    return np.column_stack([sides, buckets, *firsts]).astype(np.uint32)
