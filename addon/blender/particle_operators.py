"""Adds surface particles to a scene, bakes them to files, and frees what was baked."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import ClassVar

import bpy
from bpy.props import IntProperty

from ..fluid.errors import GoneError, InputError, MeniscusError
from ..render.particle_settings import COUNT
from .baked_particles import baked_path, pattern_for, write_particles
from .particle_mesh import has_surface_particles
from .properties import setting_property
from .sources import has_sources
from .surface_particles import CLOUDS, FollowedFluid

Result = set[str]

_NO_FLUID = "The scene has no fluid: use an object as fluid first"

_TICK = 0.001
"""Seconds until the next frame is baked; between two of them Blender handles what the user does."""

_baking: list[_Bake] = []
"""The bake that is on its way, if there is one."""


class MENISCUS_OT_surface_particles_add(bpy.types.Operator):
    """Add points that lie all over the surface of the scene's fluid and move with it, for Geometry Nodes and any renderer"""

    bl_idname = "meniscus.surface_particles_add"
    bl_label = "Add Surface Particles"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    particles: setting_property(COUNT)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not has_sources(context.scene):
            cls.poll_message_set(_NO_FLUID)
        elif context.mode != "OBJECT":
            cls.poll_message_set("Go to Object Mode first")
        else:
            return True
        return False

    def execute(self, context: bpy.types.Context) -> Result:
        item = _new_object(context, self.particles)
        # Handlers write to the mesh, in renders on a thread of their own: viewports must not read it meanwhile.
        context.scene.render.use_lock_interface = True
        CLOUDS.refresh(item.data, context.evaluated_depsgraph_get())
        if problem := CLOUDS.problem_of(item.data):
            self.report({"WARNING"}, problem)
        return {"FINISHED"}


class MENISCUS_OT_surface_particles_bake(bpy.types.Operator):
    """Write the surface particles of the active object to a file for each frame, and show these from then on"""

    bl_idname = "meniscus.surface_particles_bake"
    bl_label = "Bake Surface Particles"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    frame_start: IntProperty(name="Start", description="First frame", default=1)
    frame_end: IntProperty(name="End", description="Last frame", default=250)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        mesh = active_particles(context)
        if mesh is None:
            cls.poll_message_set("Select an object with surface particles")
        elif mesh.library is not None:
            cls.poll_message_set(f"'{mesh.name}' is linked: bake it in its own file")
        elif mesh.meniscus.baked_files:
            cls.poll_message_set("The particles are baked: free the bake first")
        elif not has_sources(context.scene):
            cls.poll_message_set(_NO_FLUID)
        elif _baking:
            cls.poll_message_set("Another bake is running: wait for it, or cancel it by Escape")
        else:
            return True
        return False

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        self._take_range(context.scene)
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context: bpy.types.Context) -> Result:
        self._take_range(context.scene)
        try:
            self._bake = _Bake(context, active_particles(context), range(self.frame_start, self.frame_end + 1))
        except MeniscusError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if bpy.app.background:
            while self._bake.advance():
                """Nobody waits for a window."""
            return self._finish(context)
        manager = context.window_manager
        manager.progress_begin(0, len(self._bake.frames))
        self._timer = manager.event_timer_add(_TICK, window=context.window)
        manager.modal_handler_add(self)
        _baking.append(self._bake)
        return {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Blender ends the bake, because another file is opened."""
        self._bake.give_up()
        _baking.remove(self._bake)

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type == "ESC" and event.value == "PRESS":
            self._bake.give_up()
            return self._finish(context)
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not self._bake.advance():
            return self._finish(context)
        done, count = len(self._bake.written), len(self._bake.frames)
        context.window_manager.progress_update(done)
        context.workspace.status_text_set(f"Meniscus bakes surface particles: {done} of {count} frames   Esc: cancel")
        return {"PASS_THROUGH"}

    def _take_range(self, scene: bpy.types.Scene) -> None:
        """What nobody has set is that of the scene."""
        for name in ("frame_start", "frame_end"):
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(scene, name))

    def _finish(self, context: bpy.types.Context) -> Result:
        if self._bake in _baking:
            _baking.remove(self._bake)
            context.window_manager.event_timer_remove(self._timer)
            context.window_manager.progress_end()
            context.workspace.status_text_set(None)
        kind, sentence = self._bake.outcome
        self.report({kind}, sentence)
        return {"FINISHED"} if kind == "INFO" else {"CANCELLED"}


class MENISCUS_OT_surface_particles_free(bpy.types.Operator):
    """Delete the files of the bake of the active object, whose surface particles are live then"""

    bl_idname = "meniscus.surface_particles_free"
    bl_label = "Free Bake"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        mesh = active_particles(context)
        if mesh is None or not mesh.meniscus.baked_files:
            cls.poll_message_set("Select an object with surface particles that are baked")
        elif mesh.library is not None:
            cls.poll_message_set(f"'{mesh.name}' is linked: free its bake in its own file")
        else:
            return True
        return False

    def execute(self, context: bpy.types.Context) -> Result:
        mesh = active_particles(context)
        settings = mesh.meniscus
        frames = range(settings.baked_start, settings.baked_end + 1)
        _delete([baked_path(settings.baked_files, frame) for frame in frames])
        CLOUDS.doubt()
        settings.baked_files = ""
        CLOUDS.refresh(mesh, context.evaluated_depsgraph_get())
        return {"FINISHED"}


class _Bake:
    """A bake on its way. Where it does not come to its end, its files are deleted."""

    def __init__(self, context: bpy.types.Context, mesh: bpy.types.Mesh, frames: range) -> None:
        if not frames:
            raise InputError(f"There is no frame from {frames.start} to {frames.stop - 1}: let the bake end after its start")
        self.frames, self.written = frames, list[Path]()
        self._scene_uid, self._view_layer_name = context.scene.session_uid, context.view_layer.name
        self._mesh_uid, self._mesh_name = mesh.session_uid, mesh.name
        self._pattern = pattern_for(mesh)
        self._frame_before = context.scene.frame_current
        self._fluid = FollowedFluid(mesh)
        self._is_given_up, self._failure = False, ""

    def advance(self) -> bool:
        """Bake the next frame; False when there is no more to do."""
        try:
            with CLOUDS.resting(self._mesh_uid):
                self._bake(self.frames[len(self.written)])
        except MeniscusError as error:
            self._failure = str(error)
            self.give_up()
            return False
        except BaseException:
            self.give_up()
            raise
        if len(self.written) < len(self.frames):
            return True
        self._show()
        return False

    def give_up(self) -> None:
        """Let all be as it was before."""
        self._is_given_up = True
        _delete(self.written)
        with suppress(GoneError):
            self._scene().frame_set(self._frame_before)

    @property
    def outcome(self) -> tuple[str, str]:
        """Kind and sentence of what to tell the user in the end."""
        if self._failure:
            return "ERROR", f"{self._failure} (nothing is baked)"
        if self._is_given_up:
            return "WARNING", f"Cancelled after {len(self.written)} of {len(self.frames)} frames: nothing is baked"
        return "INFO", f"Baked {len(self.written)} frames of surface particles to {self.written[0].parent}"

    def _bake(self, frame: int) -> None:
        scene = self._scene()
        self._mesh()  # where it was removed there is nothing to bake for
        scene.frame_set(frame)
        self._fluid.go_to(scene.view_layers[self._view_layer_name].depsgraph, viewport=False)
        path = baked_path(self._pattern, frame)
        write_particles(path, self._fluid.columns)
        self.written.append(path)

    def _show(self) -> None:
        settings = self._mesh().meniscus
        settings.baked_start, settings.baked_end = self.frames[0], self.frames[-1]
        settings.baked_files = self._pattern
        self._scene().frame_set(self._frame_before)

    def _scene(self) -> bpy.types.Scene:
        for scene in bpy.data.scenes:
            if scene.session_uid == self._scene_uid and self._view_layer_name in scene.view_layers:
                return scene
        raise GoneError("The scene or its view layer was removed")

    def _mesh(self) -> bpy.types.Mesh:
        for mesh in bpy.data.meshes:
            if mesh.session_uid == self._mesh_uid:
                return mesh
        raise GoneError(f"The surface particles '{self._mesh_name}' were removed")


def active_particles(context: bpy.types.Context) -> bpy.types.Mesh | None:
    """The surface particles that the active object shows."""
    # Without a window there is no `context.object`.
    item = context.object or context.view_layer.objects.active
    return item.data if item is not None and has_surface_particles(item.data) else None


def _new_object(context: bpy.types.Context, particles: int) -> bpy.types.Object:
    """An object with surface particles, active and selected alone."""
    mesh = bpy.data.meshes.new("Surface Particles")
    mesh.meniscus.use_surface_particles, mesh.meniscus.particles = True, particles
    item = bpy.data.objects.new(mesh.name, mesh)
    # The particles are in world space.
    item.lock_location = item.lock_rotation = item.lock_scale = (True, True, True)
    context.collection.objects.link(item)
    for other in list(context.view_layer.objects.selected):
        other.select_set(False)
    context.view_layer.update()
    if item.name in context.view_layer.objects:  # not where the active collection is excluded
        item.select_set(True)
        context.view_layer.objects.active = item
    return item


def _delete(paths: list[Path]) -> None:
    """Delete files that are there, and their folder where it is empty then."""
    for path in paths:
        path.unlink(missing_ok=True)
    for folder in {path.parent for path in paths}:
        with suppress(OSError):
            folder.rmdir()


def _draw_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    menu.layout.operator(MENISCUS_OT_surface_particles_add.bl_idname, text="Surface Particles", icon="POINTCLOUD_DATA")


_CLASSES = (MENISCUS_OT_surface_particles_add, MENISCUS_OT_surface_particles_bake, MENISCUS_OT_surface_particles_free)


def register() -> None:
    """Offer the operators."""
    for operator in _CLASSES:
        bpy.utils.register_class(operator)
    bpy.types.VIEW3D_MT_add.append(_draw_menu)


def unregister() -> None:
    """Take them away."""
    bpy.types.VIEW3D_MT_add.remove(_draw_menu)
    for operator in reversed(_CLASSES):
        bpy.utils.unregister_class(operator)
