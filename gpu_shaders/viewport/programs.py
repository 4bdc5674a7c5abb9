"""Programs that Blender's graphics module compiles, for OpenGL, Vulkan or Metal: it declares what goes in and out itself."""

from __future__ import annotations

from dataclasses import dataclass

from ...addon.fluid.look import look_constants
from ..glsl import Source


@dataclass(frozen=True)
class ViewportProgram:
    """A program that draws a quad from textures.

    Its vertex shader gets ``corner`` (-1 to 1) and its fragment shader writes ``out_color``; both get ``params``.

    Attributes
    ----------
    name
        The name of its files in this folder.
    params
        Name of the structure in NAME_params.glsl, made of vec4 and mat4 only.
    samplers
        Names of the textures, 32-bit floats in two dimensions.
    varyings
        Names of the vec2 values that go from the vertex shader to the fragment shader.
    writes_depth
        Whether the fragment shader writes ``gl_FragDepth``.
    constants
        Names and values of the ``#define`` lines of the fragment shader.
    """

    name: str
    params: str
    samplers: tuple[str, ...]
    varyings: tuple[str, ...] = ()
    writes_depth: bool = False
    constants: tuple[tuple[str, object], ...] = ()

    @property
    def structure(self) -> str:
        """GLSL of the structure of parameters."""
        return Source(f"viewport/{self.name}_params.glsl").body

    def sources(self) -> dict[str, Source]:
        """Its shaders by stage, "vertex" and "fragment".

        Their texts declare what Blender would, for compilers that know nothing of Blender, which takes their bodies.
        """
        params = [self.structure, f"layout(std140) uniform Params {{ {self.params} params; }};"]
        vertex = ["in vec2 corner;", *(f"out vec2 {name};" for name in self.varyings)]
        fragment = [f"uniform sampler2D {name};" for name in self.samplers]
        fragment += [*(f"in vec2 {name};" for name in self.varyings), "out vec4 out_color;"]
        return {
            "vertex": Source(f"viewport/{self.name}.vert", declarations=[*params, *vertex]),
            "fragment": Source(f"viewport/{self.name}.frag", dict(self.constants), declarations=[*params, *fragment]),
        }


SHADE = ViewportProgram(
    "shade",
    "ShadeParams",
    ("depth_tx", "normal_tx", "value_tx", "importance_tx", "thickness_tx", "table_tx"),
    constants=tuple(look_constants().items()),
)
SHOW = ViewportProgram("show", "ShowParams", ("depth_tx", "shaded_tx"), ("place",), writes_depth=True)


def all_programs() -> tuple[ViewportProgram, ...]:
    """Each program that a viewport may use."""
    return SHADE, SHOW
