"""What a Blender must not say on its standard error."""

from __future__ import annotations

import re

_COMPLAINT = re.compile(
    r"Traceback \(most recent call last\)|GL_(?:INVALID|OUT_OF)_\w+|GPU(?:Shader|Texture|FrameBuffer)?: .*error"
    r"|^ERROR \(gpu|\bgpu\b.*\bERROR\b|not freed memory blocks|Segmentation fault",
    re.IGNORECASE | re.MULTILINE,
)


def complaints(text: str) -> list[str]:
    """The lines of what a Blender wrote to its standard error that tell of an error of a script, of OpenGL or of memory."""
    return [line for line in text.splitlines() if _COMPLAINT.search(line)]
