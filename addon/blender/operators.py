"""What the buttons of the panels do."""

from __future__ import annotations

from typing import ClassVar

import bpy
import gpu
from bpy.props import EnumProperty

from ... import __version__
from ..fluid.errors import MeniscusError
from .compositing import MERGES, add_compositing, drawn_twice, fluid_scene_of
from .engine_name import ENGINE
from .presets import PRESETS, apply_preset
from .sources import active_source, has_sources, problem_of, use_as_fluid, use_no_more
from .viewport_status import STATUS

Result = set[str]


class MENISCUS_OT_add_sources(bpy.types.Operator):
    """Draw the particles or points of the selected objects as a fluid, in place of Blender's dots"""

    bl_idname = "meniscus.add_sources"
    bl_label = "Use as Fluid"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _selected(context):
            cls.poll_message_set("Select an object that has particles or points")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> Result:
        selected = _selected(context)
        problems = {item.name: problem_of(item) for item in selected}
        added = [item for item in selected if not problems[item.name]]
        for item in added:
            use_as_fluid(item)
        for name, problem in problems.items():
            if problem:
                self.report({"WARNING"}, f"'{name}' {problem}")
        if not added:
            return {"CANCELLED"}
        context.scene.meniscus.use_viewport = True
        context.scene.meniscus.source_index = context.scene.objects.find(added[0].name)
        return {"FINISHED"}


class MENISCUS_OT_remove_source(bpy.types.Operator):
    """Use the source that is chosen in the list as fluid no more; the object stays"""

    bl_idname = "meniscus.remove_source"
    bl_label = "Remove Source"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        source = active_source(context.scene)
        if source is None:
            cls.poll_message_set("The scene has no source")
        elif source.library is not None:
            cls.poll_message_set(f"'{source.name}' is linked: remove it in its own file")
        return source is not None and source.library is None

    def execute(self, context: bpy.types.Context) -> Result:
        use_no_more(active_source(context.scene))
        return {"FINISHED"}


class MENISCUS_OT_select_source(bpy.types.Operator):
    """Select the object of the source that is chosen in the list, and nothing else"""

    bl_idname = "meniscus.select_source"
    bl_label = "Select Source"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        source = active_source(context.scene)
        if source is None:
            cls.poll_message_set("The scene has no source")
        elif context.mode != "OBJECT":
            cls.poll_message_set("Go to Object Mode first")
        elif not source.visible_get():
            cls.poll_message_set(f"'{source.name}' is hidden: show it first")
        else:
            return True
        return False

    def execute(self, context: bpy.types.Context) -> Result:
        source = active_source(context.scene)
        for item in _selected(context):
            item.select_set(False)
        source.select_set(True)
        context.view_layer.objects.active = source
        return {"FINISHED"}


class MENISCUS_OT_apply_preset(bpy.types.Operator):
    """Set kernel, isovalue and look of the scene"""

    bl_idname = "meniscus.apply_preset"
    bl_label = "Apply Preset"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    preset: EnumProperty(
        name="Preset",
        description="Settings that go together",
        items=[(preset.name, preset.label, preset.description) for preset in PRESETS.values()],
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return PRESETS[properties.preset].description

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.library is not None:
            cls.poll_message_set("The scene is linked: change it in its own file")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> Result:
        apply_preset(context.scene, PRESETS[self.preset])
        return {"FINISHED"}


class MENISCUS_OT_copy_problem(bpy.types.Operator):
    """Copy what is wrong to the clipboard, with what a report of it needs"""

    bl_idname = "meniscus.copy_problem"
    bl_label = "Copy Problem"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        if not STATUS.problem:
            cls.poll_message_set("There is no problem")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> Result:
        context.window_manager.clipboard = problem_text()
        self.report({"INFO"}, "Copied to the clipboard")
        return {"FINISHED"}


class MENISCUS_OT_add_compositing(bpy.types.Operator):
    """Lay the fluid, rendered in a scene of its own, over this one. Objects that are only fluid lose their ray visibility"""

    bl_idname = "meniscus.add_compositing"
    bl_label = "Composite Fluid over Scene"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    merge: EnumProperty(name="Merge", description="How fluid and scene are put together", items=MERGES, default="HOLDOUT")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scene = context.scene
        fluid = fluid_scene_of(scene)
        if scene.render.engine == ENGINE:
            cls.poll_message_set("Meniscus renders this scene itself: choose Cycles or EEVEE as its engine first")
        elif not has_sources(scene):
            cls.poll_message_set("The scene has no fluid: use an object as fluid first")
        elif fluid is not None:
            cls.poll_message_set(f"The compositor lays the fluid of '{fluid.name}' over this scene already")
        else:
            return True
        return False

    def execute(self, context: bpy.types.Context) -> Result:
        try:
            fluid = add_compositing(context.scene, context.view_layer, self.merge)
        except MeniscusError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if names := ", ".join(f"'{name}'" for name in drawn_twice(context.scene)):
            problem = f"This scene's engine still draws {names} in the place of the fluid: have particles rendered as None"
            self.report({"WARNING"}, problem)
        self.report({"INFO"}, f"Renders now lay the fluid of '{fluid.name}' over this scene")
        return {"FINISHED"}


def _selected(context: bpy.types.Context) -> list[bpy.types.Object]:
    return list(context.view_layer.objects.selected)


def problem_text() -> str:
    """What is wrong, and where: for a report."""
    versions = f"Meniscus {__version__}, Blender {bpy.app.version_string}, {bpy.app.build_platform.decode()}"
    try:
        device = f"{gpu.platform.backend_type_get()}: {gpu.platform.renderer_get()}, {gpu.platform.version_get()}"
    except SystemError:  # without a window Blender has no graphics
        device = "no graphics"
    return "\n".join(part for part in (STATUS.problem, versions, device, STATUS.details) if part)


_CLASSES = (
    MENISCUS_OT_add_sources,
    MENISCUS_OT_remove_source,
    MENISCUS_OT_add_compositing,
    MENISCUS_OT_select_source,
    MENISCUS_OT_apply_preset,
    MENISCUS_OT_copy_problem,
)


def register() -> None:
    """Make the operators known."""
    for operator in _CLASSES:
        bpy.utils.register_class(operator)


def unregister() -> None:
    """Remove the operators."""
    for operator in reversed(_CLASSES):
        bpy.utils.unregister_class(operator)
