"""The particles in the memory of the graphics processor."""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt

from ....addon.render.surface_particles import ParticleCloud
from ...context import GpuContext
from ...image_cells import plain
from ...programs import ROW_TEXTURE_WIDTH

FloatArray = npt.NDArray[np.float32]


class ParticleTexture:
    """Floats of particles, one texel each, to be read and drawn; rows of ROW_TEXTURE_WIDTH."""

    def __init__(self, context: GpuContext, count: int, components: int) -> None:
        self.size = ROW_TEXTURE_WIDTH, max(-(-count // ROW_TEXTURE_WIDTH), 1)
        self._count, self._components = count, components
        self.texture = plain(context.gl.texture(self.size, components, dtype="f4"))

    def write(self, rows: FloatArray) -> None:
        """Set (count, components)."""
        whole = np.zeros((self.size[0] * self.size[1], self._components), np.float32)
        whole[: len(rows)] = rows
        self.texture.write(whole)

    def read(self) -> FloatArray:
        """(count, components)."""
        return np.frombuffer(self.texture.read(), np.float32).reshape(-1, self._components)[: self._count]


class ParticleState:
    """Where particles are, see state.glsl; made and used on the context's thread.

    Attributes
    ----------
    count
        Of the particles, also of those that are lost.
    """

    def __init__(self, context: GpuContext, count: int) -> None:
        self.count = count
        self._places, self._normals = ParticleTexture(context, count, 4), ParticleTexture(context, count, 4)
        self.framebuffer: moderngl.Framebuffer = context.gl.framebuffer([self._places.texture, self._normals.texture])
        self.places_alone: moderngl.Framebuffer = context.gl.framebuffer([self._places.texture])

    @classmethod
    def of(cls, context: GpuContext, cloud: ParticleCloud) -> ParticleState:
        """Particles whose positions count from the anchor."""
        positions, normals = cloud.positions, cloud.normals
        state = cls(context, len(positions))
        state._places.write(np.column_stack([positions, cloud.scales]))
        state._normals.write(np.column_stack([normals, np.zeros(len(normals), np.float32)]))
        return state

    @property
    def textures(self) -> dict[str, moderngl.Texture]:
        """By sampler name."""
        return {"place_tx": self._places.texture, "normal_tx": self._normals.texture}

    @property
    def uniforms(self) -> dict[str, object]:
        """What shaders ask of it."""
        return {"particle_count": self.count}

    def read(self) -> tuple[FloatArray, FloatArray]:
        """Places (M, 4) and normals (M, 4), see state.glsl."""
        return self._places.read(), self._normals.read()


class Discs:
    """What particles draw, see note.frag."""

    def __init__(self, context: GpuContext, count: int) -> None:
        self._along, self._across = ParticleTexture(context, count, 4), ParticleTexture(context, count, 4)
        self.framebuffer: moderngl.Framebuffer = context.gl.framebuffer([self._along.texture, self._across.texture])

    @property
    def textures(self) -> dict[str, moderngl.Texture]:
        """By sampler name."""
        return {"bend_along_tx": self._along.texture, "bend_across_tx": self._across.texture}


class Pressures:
    """What particles do to one another, see crowd.glsl."""

    def __init__(self, context: GpuContext, count: int) -> None:
        self._pressure, self._company = ParticleTexture(context, count, 4), ParticleTexture(context, count, 1)
        self.framebuffer: moderngl.Framebuffer = context.gl.framebuffer([self._pressure.texture, self._company.texture])

    @property
    def textures(self) -> dict[str, moderngl.Texture]:
        """By sampler name."""
        return {"pressure_tx": self._pressure.texture, "company_tx": self._company.texture}

    def bind_to_images(self) -> None:
        """Have compute shaders write it as images 0 and 1."""
        self._pressure.texture.bind_to_image(0, read=False, write=True)
        self._company.texture.bind_to_image(1, read=False, write=True)

    def read_company(self) -> FloatArray:
        """(M,): how many others each has within reach."""
        return self._company.read()[:, 0]
