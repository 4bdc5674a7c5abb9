"""Which objects of a scene supply balls, and where they stand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.errors import InputError
from .moving import place_may_move
from .particle_mesh import has_surface_particles


class NoSourceError(InputError):
    """No object of the scene is used as fluid."""


def settings_of(owner: bpy.types.ID, depsgraph: bpy.types.Depsgraph) -> bpy.types.PropertyGroup:
    """The ``meniscus`` properties of an object or a scene that `depsgraph` evaluated, at its current frame.

    In the viewport the original ones: evaluated ones miss what was changed since Blender last copied them, and to ask for a
    copy starts unbaked simulations anew. In a render the evaluated ones: they are new, and safe from changes meanwhile.
    """
    return owner.meniscus if depsgraph.mode == "RENDER" else owner.original.meniscus


@dataclass(frozen=True)
class Source:
    """A fluid object at one place in the scene. Valid only until the next one is taken.

    Attributes
    ----------
    object
        The evaluated object.
    settings
        How it supplies balls, its ``meniscus`` properties.
    data
        Its geometry, or the further geometry that its modifiers make; None for objects without data.
    world_from_object
        (4, 4) float64, of this place; that of an instance differs from the object's own.
    place_may_move
        Whether it may be elsewhere in other frames.
    """

    object: bpy.types.Object
    settings: bpy.types.PropertyGroup
    data: bpy.types.ID | None
    world_from_object: npt.NDArray[np.float64]
    place_may_move: bool

    @property
    def is_object_itself(self) -> bool:
        """Whether `data` is the object's own, not one of the further geometries that its modifiers make."""
        return self.data == self.object.data

    @property
    def world_from_original(self) -> npt.NDArray[np.float64]:
        """(4, 4): carries what is in world space at the object's own place to this place."""
        original = np.array(self.object.matrix_world, np.float64)
        if np.array_equal(original, self.world_from_object):
            return np.eye(4)
        if np.linalg.det(original[:3, :3]) == 0:
            raise InputError(f"The instances of '{self.object.name}' cannot be placed: give it a scale other than 0")
        return self.world_from_object @ np.linalg.inv(original)


ShownTest = Callable[[bpy.types.Object, bpy.types.Object], bool]
"""Says whether an object is visible, given the object of the view layer that puts it where it is."""


def visible_sources(
    depsgraph: bpy.types.Depsgraph, viewport: bool, space: bpy.types.SpaceView3D | None = None
) -> Iterator[Source]:
    """The fluid objects that are visible, at each place where they stand, instances too.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph.
    viewport
        Whether visibility in the viewport counts rather than visibility in renders.
    space
        The viewport whose local view counts; None for none.

    Raises
    ------
    NoSourceError
        No object is used as fluid.
    InputError
        A render shows one that the viewport's dependency graph does not hold.
    """
    evaluated = (item for item in depsgraph.ids if isinstance(item, bpy.types.Object))
    used = (item for item in evaluated if settings_of(item, depsgraph).use_fluid)
    fluid = {item.as_pointer() for item in used if not has_surface_particles(item.original.data)}
    if not fluid and not any(item.meniscus.use_fluid for item in depsgraph.scene.objects):
        raise NoSourceError(
            "No object supplies balls: enable Meniscus in the object properties of one with particles or points"
        )
    is_shown = (
        shown_in_viewport(depsgraph, space) if viewport else shown_in_render(depsgraph, lambda item: item.meniscus.use_fluid)
    )
    for source, owner in _places(depsgraph, fluid):
        if is_shown(source.object, owner):
            yield source


def shown_in_viewport(depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D | None) -> ShownTest:
    """Whether a viewport shows an object; without one the view layer decides."""
    # The dependency graph also holds the objects of hidden collections, because a viewport may have its own choice of them.
    return lambda item, owner: owner.original.visible_get(view_layer=depsgraph.view_layer, viewport=space)


def shown_in_render(depsgraph: bpy.types.Depsgraph, is_missed: Callable[[bpy.types.Object], bool]) -> ShownTest:
    """Whether a render shows an object.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph.
    is_missed
        Whether an original object is missed that a render shows and the viewport's dependency graph does not list.

    Raises
    ------
    InputError
        An object is missed.
    """
    if depsgraph.mode == "RENDER":
        return lambda item, owner: True
    renderable = _renderable_objects(depsgraph.view_layer)
    _check_evaluated(depsgraph, renderable, is_missed)
    return lambda item, owner: not item.hide_render and owner.original.as_pointer() in renderable


def _places(depsgraph: bpy.types.Depsgraph, fluid: set[int]) -> Iterator[tuple[Source, bpy.types.Object]]:
    """Each place of the objects in `fluid` (addresses), with the object of the view layer that puts it there."""
    # Walking instances is slow where particles are drawn as many objects, so it is done only where fluid may be among them.
    if not any(_may_instance_fluid(item, depsgraph) for item in depsgraph.objects):
        for item in depsgraph.objects:
            if item.as_pointer() in fluid:
                place = np.array(item.matrix_world, np.float64)
                may_move = place_may_move(item, depsgraph.scene)
                yield Source(item, settings_of(item, depsgraph), item.data, place, may_move), item
        return
    for instance in depsgraph.object_instances:
        item = instance.instance_object if instance.is_instance else instance.object
        if item.as_pointer() in fluid:
            owner = instance.parent if instance.is_instance else item
            place = np.array(instance.matrix_world, np.float64)
            # Further geometry of an object stands where that does; other instances may be moved by whatever makes them.
            is_own = owner == item and np.array_equal(place, np.array(item.matrix_world, np.float64))
            may_move = not is_own or place_may_move(item, depsgraph.scene)
            yield Source(item, settings_of(item, depsgraph), instance.object.data, place, may_move), owner


def _may_instance_fluid(item: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    if item.instance_type != "NONE" or any(modifier.type == "NODES" for modifier in item.modifiers):
        return True
    instanced = (found for system in item.particle_systems for found in _instanced_objects(system.settings))
    return any(_may_be_fluid(found, depsgraph) for found in instanced)


def _may_be_fluid(item: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    return settings_of(item, depsgraph).use_fluid or item.instance_type != "NONE" or len(item.modifiers) > 0


def _instanced_objects(settings: bpy.types.ParticleSettings) -> list[bpy.types.Object]:
    """The objects that a particle system draws in place of its particles."""
    if settings.render_type == "OBJECT" and settings.instance_object:
        return [settings.instance_object]
    if settings.render_type == "COLLECTION" and settings.instance_collection:
        return list(settings.instance_collection.all_objects)
    return []


def _renderable_objects(view_layer: bpy.types.ViewLayer) -> set[int]:
    """Addresses of the original objects of a view layer that a render shows."""
    found: set[int] = set()
    pending = [view_layer.layer_collection]
    while pending:
        layer_collection = pending.pop()
        if layer_collection.collection.hide_render:
            continue
        pending.extend(layer_collection.children)
        if not layer_collection.exclude:
            found.update(item.as_pointer() for item in layer_collection.collection.objects if not item.hide_render)
    return found


def _check_evaluated(
    depsgraph: bpy.types.Depsgraph, renderable: set[int], is_missed: Callable[[bpy.types.Object], bool]
) -> None:
    missing = renderable - {item.original.as_pointer() for item in depsgraph.objects}
    for item in depsgraph.view_layer.objects:
        if item.as_pointer() in missing and is_missed(item):
            raise InputError(
                f"'{item.name}' is hidden in the viewport only, where Blender evaluates this render: "
                "show it there, or disable it in renders too"
            )
