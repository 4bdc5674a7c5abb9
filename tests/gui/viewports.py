"""The windows of a running Blender, their viewports, and what the screen shows of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from event_loop import DEADLINE, turns, wait_until
from mathutils import Quaternion
from pictures import Picture, screen_picture

OVERLAYS = ["floor", "axis_x", "axis_y", "axis_z", "ortho_grid", "cursor", "object_origins", "extras", "relationship_lines"]
OVERLAYS = [f"show_{name}" for name in (*OVERLAYS, "outline_selected", "text", "annotation")]
"""All that would be seen. Overlays as such stay on: without them Blender 4.3 has no depth of meshes beside EEVEE's pictures."""


@dataclass(frozen=True)
class Viewport:
    """A 3D viewport: one of its window's areas, and one of that area's views (there are four of them in a quad view).

    It holds the places, not the things: those that Blender hands out are void after undo and after loading a file.
    """

    window_index: int = 0
    area_index: int = 0
    view_index: int = 0

    @property
    def window(self) -> bpy.types.Window:
        return bpy.context.window_manager.windows[self.window_index]

    @property
    def area(self) -> bpy.types.Area:
        return [area for area in self.window.screen.areas if area.type == "VIEW_3D"][self.area_index]

    @property
    def space(self) -> bpy.types.SpaceView3D:
        return self.area.spaces.active

    @property
    def region(self) -> bpy.types.Region:
        return [region for region in self.area.regions if region.type == "WINDOW"][self.view_index]

    @property
    def view(self) -> bpy.types.RegionView3D:
        return self.region.data or self.space.region_3d

    @property
    def clip_from_world(self) -> np.ndarray:
        """(4, 4) float64: what the viewport looks through."""
        return np.array(self.view.window_matrix, np.float64) @ np.array(self.view.view_matrix, np.float64)

    @contextmanager
    def override(self) -> Iterator[None]:
        """Make it what operators work on. Do not let turns pass within."""
        with bpy.context.temp_override(window=self.window, area=self.area, region=self.region):
            yield

    def redraw(self, count: int = 1) -> None:
        """Have it drawn `count` times, whether something has changed or not."""
        for _ in range(count):
            self.region.tag_redraw()
            turns()

    def picture(self) -> Picture:
        """What the screen shows of it now."""
        return region_picture(self.window, self.region)


def viewport() -> Viewport:
    """The first viewport of the first window, in which objects have exact colours: no overlays, no antialiasing."""
    first = Viewport()
    with bpy.context.temp_override(window=first.window):
        bpy.context.preferences.system.viewport_aa = "OFF"
    make_plain(first.space)
    return first


def make_plain(space: bpy.types.SpaceView3D) -> None:
    """Show the objects alone, each in its own colour, before a background of one colour."""
    for name in OVERLAYS:
        setattr(space.overlay, name, False)
    space.show_gizmo = False
    space.show_region_header = space.show_region_tool_header = space.show_region_toolbar = space.show_region_ui = False
    shading = space.shading
    shading.type = "SOLID"
    shading.light, shading.color_type = "FLAT", "OBJECT"
    shading.background_type, shading.background_color = "VIEWPORT", (0.1, 0.1, 0.1)
    shading.show_object_outline = shading.show_specular_highlight = False


def look(
    view: bpy.types.RegionView3D, rotation: Quaternion, distance: float, location=(0.0, 0.0, 0.0), perspective="PERSP"
) -> None:
    """Let a viewport look at `location` (world space) from `distance`, rotated from the view along -z."""
    view.view_perspective = perspective
    view.view_rotation, view.view_distance, view.view_location = rotation, distance, location
    view.update()


def shrunk(shown: Viewport) -> Viewport:
    """A small part of a viewport; the rest of the window shows what is drawn quickly, and seldom."""
    for direction in ("VERTICAL", "HORIZONTAL"):
        with shown.override():
            bpy.ops.screen.area_split(direction=direction, factor=0.3)
        turns(3)
    kept = shown.area
    for area in shown.window.screen.areas:
        if area != kept and area.height > 100:
            area.type = "CONSOLE"
    turns(3)
    return Viewport()


def region_picture(window: bpy.types.Window, region: bpy.types.Region) -> Picture:
    """What the screen shows of a region of a window now."""
    x, y = window.x + region.x, window.y + region.y
    return screen_picture()[y : y + region.height, x : x + region.width]


def settled(shown: Viewport, at_rest=lambda: True, seconds: float = DEADLINE) -> Picture:
    """The picture of a viewport once it changes no more: nothing more is to come (`at_rest`), and it stays the same."""
    same, last = 0, shown.picture()

    def is_settled() -> bool:
        nonlocal same, last
        now = shown.picture()
        same = same + 1 if at_rest() and np.array_equal(now, last) else 0
        last = now
        return same >= 5

    turns(2)
    wait_until(is_settled, "a picture that changes no more", seconds)
    return last
