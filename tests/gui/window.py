"""Blender's window, as the user sees it."""

import os
from pathlib import Path

import bpy
import numpy as np


def redraw(times=2):
    """Draw the first window so often."""
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, screen=window.screen):
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=times)


def screenshot():
    """(height, width, 3) bytes, blue first: what the X server shows. It keeps its screen in an XWD file."""
    content = Path(os.environ["MENISCUS_SCREEN"]).read_bytes()
    header_size, _, _, _, width, height, *_ = header = np.frombuffer(content, ">u4", 25).tolist()
    bytes_per_line, color_count = header[12], header[19]
    pixels = np.frombuffer(content, np.uint8, bytes_per_line * height, header_size + 12 * color_count)
    return pixels.reshape(height, bytes_per_line)[:, : 4 * width].reshape(height, width, 4)[..., :3].copy()
