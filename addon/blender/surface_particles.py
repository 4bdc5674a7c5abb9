"""Surface particles of a scene's fluid, put into the points of meshes: live at each change, or from the files of a bake.

Handlers run in renders, too, and in the background. Blender evaluates what a handler has changed once more before it draws or
renders, without calling handlers again. Other scenes and view layers that show the same mesh are evaluated, too, with handlers:
after a render those of viewports, which so get back what they show.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..fluid.balls import Balls
from ..fluid.errors import InputError, MeniscusError
from ..fluid.field import Field
from ..render.particle_follower import ParticleFollower
from ..render.particle_settings import SIMULATION_SETTINGS, simulation_options
from ..render.surface_particles import SurfaceParticles
from .baked_particles import baked_path, read_particles
from .changes import CHANGES
from .handlers import add_handlers, remove_handlers
from .particle_mesh import Columns, columns_of, has_surface_particles, no_particles, put_particles
from .preferences import threads_of
from .read_scene import frame_seconds, read_field, read_fluid, scene_seconds
from .scene_balls import same_balls
from .visible_sources import NoSourceError

NO_BALLS = "The fluid has no ball at this frame, so there are no surface particles"
NO_SURFACE = "The fluid has no surface, because its density reaches the isovalue nowhere: lower the isovalue"


class FollowedFluid:
    """Surface particles of a mesh's settings, brought from frame to frame of a scene."""

    def __init__(self, mesh: bpy.types.Mesh) -> None:
        self.options = options_of(mesh)
        self._follower = ParticleFollower(SurfaceParticles(**self.options))
        self._shown: tuple[Balls, Field] | None = None

    def go_to(self, depsgraph: bpy.types.Depsgraph, *, viewport: bool) -> bool:
        """Bring the particles to what a dependency graph shows; False where they are there already.

        `viewport` is that of :func:`read_scene.read_fluid`. Velocities are those that the fluid has; nothing is read from other
        frames.

        Raises
        ------
        InputError, DeviceError
            The fluid cannot be read, or a setting is unusable.
        """
        scene = depsgraph.scene_eval if depsgraph.mode == "RENDER" else depsgraph.scene
        balls, field = _with_finite_velocities(read_fluid(depsgraph, viewport=viewport).balls), read_field(scene)
        before, self._shown = self._shown, None
        if before is not None and same_balls(balls, before[0]):
            balls = before[0]
        self._follower.go_to(balls, field, scene_seconds(scene), threads=threads_of(scene))
        self._shown = balls, field
        return before is None or before[0] is not balls or before[1] != field

    @property
    def columns(self) -> Columns:
        """What the mesh is to have of the particles."""
        return columns_of(self._follower.particles.cloud)

    @property
    def problem(self) -> str:
        """Why there are none; empty where there are some."""
        if len(self._follower.particles):
            return ""
        return NO_SURFACE if self._shown is not None and len(self._shown[0]) else NO_BALLS


def options_of(mesh: bpy.types.Mesh) -> dict[str, Any]:
    """The arguments of :class:`surface_particles.SurfaceParticles` that a mesh's settings say."""
    settings = mesh.meniscus
    values = {setting.name: getattr(settings, setting.name) for setting in SIMULATION_SETTINGS}
    return {**simulation_options(values), "seed": settings.seed}


def _with_finite_velocities(balls: Balls) -> Balls:
    """The same balls; those whose velocity is not finite stand still."""
    if balls.velocities is None or np.isfinite(balls.velocities).all():
        return balls
    finite = np.isfinite(balls.velocities).all(axis=1, keepdims=True)
    velocities = np.where(finite, balls.velocities, np.float32(0))
    return Balls(balls.positions, balls.radii, balls.weights, balls.colors, velocities, balls.ids, balls.sources)


class _Shown:
    """What a mesh shows.

    Attributes
    ----------
    seen
        For each scene and mode of evaluation, when and what was looked at last.
    fluid
        Live particles, None where there are none yet.
    is_whole
        Whether the mesh has them; Blender's undo may have put others in their place.
    problem
        What is wrong, one sentence; empty where nothing is.
    """

    def __init__(self) -> None:
        self.seen: dict[Hashable, Hashable] = {}
        self.fluid: FollowedFluid | None = None
        self.is_whole = False
        self.problem = ""


class Clouds:
    """The surface particles of all meshes, by their session's numbers."""

    def __init__(self) -> None:
        self._shown: dict[int, _Shown] = {}
        self._resting: set[int] = set()
        # A render has a thread of its own.
        self._lock = threading.RLock()

    def problem_of(self, mesh: bpy.types.Mesh) -> str:
        """What is wrong with a mesh's particles, one sentence; empty where nothing is."""
        shown = self._shown.get(mesh.session_uid)
        return shown.problem if shown else ""

    def refresh_all(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Bring all meshes with surface particles that a dependency graph holds up to date."""
        if not any(mesh.meniscus.use_surface_particles for mesh in bpy.data.meshes):
            return
        for mesh in [item.original for item in depsgraph.ids if isinstance(item, bpy.types.Mesh)]:
            if has_surface_particles(mesh) and mesh.session_uid not in self._resting:
                self.refresh(mesh, depsgraph)

    def refresh(self, mesh: bpy.types.Mesh, depsgraph: bpy.types.Depsgraph) -> None:
        """Bring a mesh up to date, where that may be needed; what is wrong is noted."""
        with self._lock:
            shown = self._shown.setdefault(mesh.session_uid, _Shown())
            moment = _moment(mesh, depsgraph)
            place = depsgraph.scene.session_uid, depsgraph.mode
            if mesh.is_editmode or (shown.is_whole and shown.seen.get(place) == moment):
                return
            shown.seen[place] = moment
            try:
                problem = _show(mesh, depsgraph, shown)
            except NoSourceError as error:
                shown.fluid = None
                put_particles(mesh, no_particles())
                problem = str(error)
            except MeniscusError as error:
                problem = str(error)
            shown.is_whole = True
            self._tell(mesh, shown, problem)

    @staticmethod
    def _tell(mesh: bpy.types.Mesh, shown: _Shown, problem: str) -> None:
        if problem and problem != shown.problem and bpy.app.background:
            print(f"'{mesh.name}': {problem}", file=sys.stderr)
        shown.problem = problem

    @contextmanager
    def resting(self, uid: int) -> Iterator[None]:
        """Leave a mesh, by its `session_uid`, as it is for a while."""
        self._resting.add(uid)
        try:
            yield
        finally:
            self._resting.discard(uid)

    def doubt(self) -> None:
        """Meshes may have lost what they had."""
        for shown in self._shown.values():
            shown.is_whole = False

    def forget(self) -> None:
        """Another file is open."""
        self._shown.clear()


CLOUDS = Clouds()
"""Of the open file."""


def _moment(mesh: bpy.types.Mesh, depsgraph: bpy.types.Depsgraph) -> Hashable:
    """What a mesh's particles depend on."""
    settings, scene = mesh.meniscus, depsgraph.scene
    source = settings.baked_files or (settings.use_live, *options_of(mesh).values(), CHANGES.revision, read_field(scene))
    return source, scene_seconds(scene)


def _show(mesh: bpy.types.Mesh, depsgraph: bpy.types.Depsgraph, shown: _Shown) -> str:
    """Let a mesh show what it should; what is wrong, one sentence, empty where nothing is."""
    if mesh.library is not None:
        raise InputError(f"'{mesh.name}' is linked, so its points cannot change: append it instead")
    if mesh.meniscus.baked_files:
        _show_baked(mesh, depsgraph.scene)
        return ""
    return _show_live(mesh, depsgraph, shown) if mesh.meniscus.use_live else ""


def _show_live(mesh: bpy.types.Mesh, depsgraph: bpy.types.Depsgraph, shown: _Shown) -> str:
    if shown.fluid is None or shown.fluid.options != options_of(mesh):
        shown.fluid = FollowedFluid(mesh)
    # Without viewports whatever is evaluated is for renders, also the graph that the command line reads.
    is_for_viewport = depsgraph.mode == "VIEWPORT" and not bpy.app.background
    if shown.fluid.go_to(depsgraph, viewport=is_for_viewport) or not shown.is_whole:
        put_particles(mesh, shown.fluid.columns)
    return shown.fluid.problem


def _show_baked(mesh: bpy.types.Mesh, scene: bpy.types.Scene) -> None:
    """Show the file of the nearest frame, its particles where they are at the present time."""
    settings = mesh.meniscus
    frame = min(max(scene.frame_current, settings.baked_start), settings.baked_end)
    subframe = scene.frame_subframe if frame == scene.frame_current else 0.0
    if subframe > 0.5 and frame < settings.baked_end:
        frame, subframe = frame + 1, subframe - 1
    path = baked_path(settings.baked_files, frame)
    put_particles(mesh, read_particles(path, subframe * frame_seconds(scene)))


@persistent
def _refresh(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    CLOUDS.refresh_all(depsgraph)


@persistent
def _doubt(*_: object) -> None:
    CLOUDS.doubt()


@persistent
def _forget(*_: object) -> None:
    CLOUDS.forget()


_HANDLERS = {
    "frame_change_post": _refresh,
    "depsgraph_update_post": _refresh,
    "undo_post": _doubt,
    "redo_post": _doubt,
    "load_post": _forget,
}


def register() -> None:
    """Keep surface particles up to date from now on."""
    add_handlers(_HANDLERS)


def unregister() -> None:
    """Leave them as they are."""
    remove_handlers(_HANDLERS)
    CLOUDS.forget()
