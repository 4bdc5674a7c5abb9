"""How much an OpenGL context can take at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Limits:
    """The limits of a context that a method may come to; in brackets what OpenGL 3.3 guarantees.

    Attributes
    ----------
    texture_size
        Width and height of a texture in texels (1024).
    texture_buffer_size
        Texels of a buffer texture (65536).
    viewport_size
        Width and height in pixels of what is drawn at once (1024).
    draw_buffers
        Render targets that a fragment shader writes at once (8).
    storage_blocks
        Storage blocks of a compute shader; 0 where there are none (8 in OpenGL 4.3).
    storage_block_bytes
        Size of a storage block (16 MB in OpenGL 4.3).
    """

    texture_size: int
    texture_buffer_size: int
    viewport_size: int
    draw_buffers: int
    storage_blocks: int
    storage_block_bytes: int

    @classmethod
    def from_info(cls, info: Mapping[str, Any]) -> Limits:
        """The limits in what moderngl knows of a context (``Context.info``)."""
        return cls(
            texture_size=info["GL_MAX_TEXTURE_SIZE"],
            texture_buffer_size=info["GL_MAX_TEXTURE_BUFFER_SIZE"],
            viewport_size=min(info["GL_MAX_VIEWPORT_DIMS"]),
            # Every draw buffer needs an attachment.
            draw_buffers=min(info["GL_MAX_DRAW_BUFFERS"], info["GL_MAX_COLOR_ATTACHMENTS"]),
            storage_blocks=min(
                info.get("GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS", 0), info.get("GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS", 0)
            ),
            storage_block_bytes=info.get("GL_MAX_SHADER_STORAGE_BLOCK_SIZE", 0),
        )
