"""The balls that a viewport shows, read again only when something has changed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..fluid.balls import Balls
from .changes import Changes
from .read_scene import Fluid, read_fluid
from .scene_notes import collected_notes
from .visible_sources import NoSourceError

_ARRAYS = ("positions", "radii", "weights", "colors", "velocities", "ids", "sources")

Key = tuple[int, str, int]
"""Address of the scene, name of the view layer, and address of a viewport that shows its own choice of objects, else 0."""


@dataclass
class _Entry:
    """What was read, and when: with it the colours of balls that have none of their own."""

    read_at: tuple[int, tuple[float, ...], bool]
    fluid: Fluid | None


class SceneBalls:
    """Balls by scene, view layer and local view.

    Parameters
    ----------
    changes
        Tells when to read again.

    Attributes
    ----------
    reads
        How often a scene was read.
    """

    def __init__(self, changes: Changes) -> None:
        self._changes = changes
        self._entries: dict[Key, _Entry] = {}
        self.reads = 0

    def fluid(self, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D, uses_materials: bool = False) -> Fluid | None:
        """What a viewport shows; with the same balls as before where they are the same. None where no object supplies balls.

        Raises
        ------
        InputError
            A source lacks what its settings ask for.
        """
        if not self._changes.may_have_sources:
            return None
        key = _key(depsgraph, space)
        entry = self._entries.get(key)
        now = self._changes.revision, tuple(depsgraph.scene.meniscus.color), uses_materials
        if entry is None or entry.read_at != now:
            fluid = self._read(depsgraph, space, uses_materials)
            if (
                fluid is not None
                and entry is not None
                and entry.fluid is not None
                and same_balls(fluid.balls, entry.fluid.balls)
            ):
                fluid = replace(fluid, balls=entry.fluid.balls)
            self._entries[key] = entry = _Entry(now, fluid)
        return entry.fluid

    def _read(self, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D, uses_materials: bool) -> Fluid | None:
        self.reads += 1
        try:
            with collected_notes() as notes:
                fluid = read_fluid(depsgraph, viewport=True, space=space, uses_materials=uses_materials)
            return replace(fluid, notes=tuple(notes))
        except NoSourceError:
            self._changes.may_have_sources = _any_source()
            return None

    def forget(self) -> None:
        """Drop all, because the file is another."""
        self._entries.clear()


def _key(depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D) -> Key:
    has_own_choice = space.local_view is not None or space.use_local_collections
    return (
        depsgraph.scene.original.as_pointer(),
        depsgraph.view_layer.name,
        space.as_pointer() if has_own_choice else 0,
    )


def _any_source() -> bool:
    """In any scene: what is known of one must not hide another's."""
    return any(item.meniscus.use_fluid for item in bpy.data.objects)


def same_balls(balls: Balls, other: Balls) -> bool:
    """Whether all that balls carry is the same."""
    pairs = ((getattr(balls, name), getattr(other, name)) for name in _ARRAYS)
    return balls.dropped == other.dropped and all(
        mine is theirs if mine is None or theirs is None else np.array_equal(mine, theirs) for mine, theirs in pairs
    )
