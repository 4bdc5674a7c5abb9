"""Files that were saved by another version of the settings.

A scene's settings carry a version, which is written when a file is saved. What an older version would have shown differently is
set as it was there, when such a file is opened or a scene is appended from one.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

from .handlers import add_handlers, remove_handlers


def _keep_headlight(scene: bpy.types.Scene) -> None:
    """Before there were styles, all fluids were shown in the light of the eye."""
    if not scene.meniscus.is_property_set("style"):
        scene.meniscus.style = "headlight"


UPDATES: tuple[Callable[[bpy.types.Scene], None], ...] = (_keep_headlight,)
"""What takes a scene from each version to the next."""

CURRENT_VERSION = len(UPDATES)


def update_scene(scene: bpy.types.Scene) -> None:
    """Bring the settings of a scene from a file up to date. Those of a newer version are left alone."""
    version = scene.meniscus.version
    if scene.library is not None or version >= CURRENT_VERSION:
        return
    # A scene that never saw Meniscus looks as a new one does.
    if any(item.meniscus.use_fluid for item in scene.objects) or _was_used(scene):
        for update in UPDATES[version:]:
            update(scene)
    scene.meniscus.version = CURRENT_VERSION


def _was_used(scene: bpy.types.Scene) -> bool:
    values = {item.identifier for item in scene.meniscus.bl_rna.properties if item.type != "POINTER"}
    names = values - {"name", "version", "source_index"}
    return any(scene.meniscus.is_property_set(name) for name in names)


@persistent
def _update_file(*_: object) -> None:
    for scene in bpy.data.scenes:
        update_scene(scene)


@persistent
def _update_imported(imported: bpy.types.BlendImportContext, *_: object) -> None:
    for item in imported.import_items:
        if isinstance(item.id, bpy.types.Scene):
            update_scene(item.id)


@persistent
def _mark(*_: object) -> None:
    """What is saved now is of this version."""
    for scene in bpy.data.scenes:
        if scene.library is None and scene.meniscus.version == 0:
            scene.meniscus.version = CURRENT_VERSION


_HANDLERS = {"load_post": _update_file, "save_pre": _mark, "blend_import_post": _update_imported}
"""Before 4.3 there is none for what is appended: an old scene looks as a new one does there."""


def register() -> None:
    """Listen for files."""
    add_handlers(_HANDLERS)


def unregister() -> None:
    """Listen no more."""
    remove_handlers(_HANDLERS)
