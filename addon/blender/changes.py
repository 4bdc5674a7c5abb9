"""What has changed since the balls were read: Blender tells of changes through handlers and property updates."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.handlers import persistent

from .handlers import add_handlers, remove_handlers
from .particle_mesh import has_surface_particles

_OBJECTS_WITHOUT_BALLS = {"CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER", "ARMATURE", "LATTICE"}
"""Types of objects that supply no balls; where one moves something that does, Blender tells of that too."""


class Changes:
    """Counts the changes that may alter what the fluid is or how it is drawn.

    Attributes
    ----------
    revision
        Grows with each.
    display
        Grows with each change of how the fluid is drawn.
    structure
        Grows where objects may have come, gone, or become or ceased to be fluid.
    may_have_sources
        False where no object supplied balls when last looked, and none has come since.
    """

    def __init__(self) -> None:
        self.revision = self.display = self.structure = 0
        self.may_have_sources = True

    @property
    def now(self) -> tuple[int, int]:
        """Changes with anything that is noted here."""
        return self.revision, self.display

    def note(self) -> None:
        """Something has changed, what is not known."""
        self.revision += 1
        self.structure += 1
        self.may_have_sources = True


CHANGES = Changes()
"""Of all scenes."""


def note_source(_owner: Any, _context: bpy.types.Context) -> None:
    """To be called by Blender when a setting of an object is set by hand or by a script."""
    CHANGES.note()
    _redraw_viewports()


def note_display(_owner: Any, _context: bpy.types.Context) -> None:
    """To be called by Blender when a setting of a scene is set by hand or by a script: the balls stay what they are."""
    CHANGES.display += 1
    _redraw_viewports()


def _redraw_viewports() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


@persistent
def _note_frame(_scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph) -> None:
    CHANGES.revision += 1


@persistent
def _note_all(*_: object) -> None:
    CHANGES.note()


@persistent
def _note_updates(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    for update in depsgraph.updates:
        item = update.id
        if _shows_particles(item):
            continue
        if isinstance(item, bpy.types.Object):
            if item.type not in _OBJECTS_WITHOUT_BALLS:
                CHANGES.revision += 1
                CHANGES.may_have_sources |= item.original.meniscus.use_fluid
        elif isinstance(item, _IDS_WITH_BALLS) and not _is_setting(update):
            CHANGES.revision += 1
            CHANGES.structure += isinstance(item, (bpy.types.Scene, bpy.types.Collection))


def _shows_particles(item: bpy.types.ID) -> bool:
    """Whether it shows surface particles: these depend on the fluid, and the fluid not on them."""
    own = item.original
    return has_surface_particles(own.data if isinstance(own, bpy.types.Object) else own)


def _is_setting(update: bpy.types.DepsgraphUpdate) -> bool:
    """Whether a setting of a scene has changed, such as ours. Other changes of scenes do not tag transforms and geometry."""
    return isinstance(update.id, bpy.types.Scene) and update.is_updated_transform and update.is_updated_geometry


_IDS_WITH_BALLS = (
    bpy.types.Scene,
    bpy.types.Collection,
    bpy.types.Mesh,
    bpy.types.Curve,
    bpy.types.PointCloud,
    bpy.types.ParticleSettings,
    bpy.types.GeometryNodeTree,
    bpy.types.Material,
)
_HANDLERS = {
    "frame_change_post": _note_frame,
    "depsgraph_update_post": _note_updates,
    "undo_post": _note_all,
    "redo_post": _note_all,
    "load_post": _note_all,
}


def register() -> None:
    """Listen to Blender."""
    add_handlers(_HANDLERS)


def unregister() -> None:
    """Listen no more."""
    remove_handlers(_HANDLERS)
