"""A fluid in the viewports of a Blender, and whether it is where the oracle says."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from types import ModuleType

import bpy
import numpy as np
from event_loop import DEADLINE, turns, wait_until
from expected import FRAME, Caster, FloatArray, border_width, is_inner, nearest, srgb_bytes
from fluid_scenes import read_balls
from pictures import Picture, check_same
from viewports import Viewport, settled, viewport

FLUID_COLOR = (0.0, 0.5, 1.0)
CUBE_COLOR = (0.9, 0.2, 0.1)
BACKGROUND_COLOR = (0.1, 0.1, 0.1)
TOLERANCE = 4
"""By how much a byte of a colour may differ: software OpenGL encodes sRGB only roughly."""

MOST_SPECKS = 400
PRESENCE_TOLERANCE = 12
"""By how much a byte of a colour may differ from the fluid's where only the fluid's place is compared."""


class FluidViews:
    """The fluid of the open file in all viewports."""

    def __init__(self, package: ModuleType) -> None:
        self._package = package
        self.status = self.module("viewport_status").STATUS

    def module(self, name: str) -> ModuleType:
        """A module of the extension's Blender side."""
        return importlib.import_module(f"{self._package.__name__}.addon.blender.{name}")

    def prepare(self) -> Viewport:
        """Let the fluid and the cube have exact colours; the first viewport."""
        scene = bpy.context.scene
        scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
        scene.meniscus.style, scene.meniscus.color = "flat", FLUID_COLOR
        scene.meniscus.preview_samples = 1  # else gaps between balls show, in pixels whose centres are in the fluid
        bpy.data.objects["Cube"].color = (*CUBE_COLOR, 1)
        return viewport()

    def is_at_rest(self) -> bool:
        """Whether all viewports show the best they will show; fails where drawing has failed."""
        assert not self.status.problem, self.status.details or self.status.problem
        return self.shows_newest() and all(live.is_at_rest for live in self.lives())

    def shows_newest(self) -> bool:
        """Whether no viewport has yet to draw what it has."""
        return all(shown.drawn == shown.live.revision for shown in self._shown())

    def lives(self) -> list:
        """The live view of each viewport that shows fluid."""
        return [shown.live for shown in self._shown()]

    def _shown(self) -> list:
        drawing = self.module("viewport")._drawing
        return list(drawing._viewports.values()) if drawing else []

    def settled(self, shown: Viewport) -> Picture:
        """The picture of a viewport once it changes no more."""
        return settled(shown, self.is_at_rest)

    def caster(self) -> Caster:
        """The oracle, with the balls that the open scene has at its frame."""
        balls = read_balls(self._package, viewport=True)
        field = self.module("read_scene").read_field(bpy.context.scene)

        def cast(origins: FloatArray, directions: FloatArray) -> FloatArray:
            if len(balls) == 0:
                return np.full(len(origins), np.inf)
            # Rays that miss the box around all balls need not be followed.
            low, high = balls.bounds
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = (np.array([[low], [high]]) - origins) / directions
            meets = ends.min(axis=0).max(axis=1) <= ends.max(axis=0).min(axis=1)
            distances = np.full(len(origins), np.inf)
            if meets.any():
                distances[meets] = self._package.oracle.cast(balls, field, origins[meets], directions[meets])[0]
            return distances

        return cast

    def check_exactly(self, name: str, shown: Viewport, meshes: Sequence[Caster] = ()) -> None:
        """Compare each pixel's colour: fluid, the cubes of `meshes`, or background."""
        actual = self.settled(shown)
        labels = self.labels(shown, meshes)
        colors = np.array(list(map(srgb_bytes, (FLUID_COLOR, *[CUBE_COLOR] * len(meshes), BACKGROUND_COLOR))))
        check_same(name, actual, colors[labels], is_compared(actual, labels), TOLERANCE)

    def check_presence(self, name: str, shown: Viewport, meshes: Sequence[Caster] = (), least: int = 200) -> None:
        """Compare only at which pixels there is fluid, and that these are `least` at least."""
        actual = self.settled(shown)
        labels = self.labels(shown, meshes)
        assert (labels == 0).sum() >= least, "the test should see some fluid"
        check_same(name, actual, with_fluid(actual, labels == 0), is_compared(actual, labels), PRESENCE_TOLERANCE)

    def wait_for_meshes(self, shown: Viewport, meshes: Sequence[Caster]) -> None:
        """Wait until meshes are drawn: EEVEE leaves them out while it compiles their shaders."""
        is_mesh = self.labels(shown, meshes) > 0

        def are_drawn() -> bool:
            picture = shown.picture().astype(int)
            differs = np.abs(picture[is_mesh] - picture[FRAME, FRAME]).max(axis=1) > 2 * PRESENCE_TOLERANCE
            # Software Vulkan draws specks at the borders of meshes that are not drawn yet.
            return differs.mean() > 0.3

        # Without the fluid, which would show where the meshes are not yet.
        settings = bpy.context.scene.meniscus
        settings.use_viewport = False
        try:
            wait_until(lambda: not self.lives(), "a viewport without fluid")
            turns(3)  # until that is on the screen
            wait_until(are_drawn, "the cube in EEVEE", 3 * DEADLINE)
        finally:
            settings.use_viewport = True

    def check_absence(self, name: str, shown: Viewport) -> None:
        """No pixel shows fluid."""
        actual = self.settled(shown)
        check_same(name, actual, with_fluid(actual, np.zeros(actual.shape[:2], np.bool_)), tolerance=PRESENCE_TOLERANCE)

    def is_fluid(self, clip_from_world: FloatArray, shape: Sequence[int]) -> np.ndarray:
        """(height, width): where there is fluid, with no mesh, at the frame that the open scene has."""
        return nearest([self.caster()], clip_from_world, shape[1], shape[0]) == 0

    def labels(self, shown: Viewport, meshes: Sequence[Caster]) -> np.ndarray:
        """(height, width): 0 where there is fluid, 1 and more for the meshes, -1 for the background."""
        return nearest([self.caster(), *meshes], shown.clip_from_world, shown.region.width, shown.region.height)


def is_compared(picture: Picture, labels: np.ndarray) -> np.ndarray:
    """(height, width): away from borders. Software Vulkan leaves black specks at those of meshes, also of hidden ones."""
    if border_width() == 1:
        return is_inner(labels)
    specks = (picture == 0).all(axis=2)
    assert specks.sum() < MOST_SPECKS
    return is_inner(labels) & ~specks


def is_bluish(colors: np.ndarray) -> np.ndarray:
    """(height, width): whether a pixel is the fluid and nothing else of a test's scene, whatever way colours are encoded."""
    return colors[..., 2] > 2 * colors[..., 0]


def shows_fluid(picture: Picture) -> np.ndarray:
    """(height, width): whether a pixel has the fluid's colour."""
    return np.abs(picture.astype(int) - srgb_bytes(FLUID_COLOR)).max(axis=2) <= PRESENCE_TOLERANCE


def mask(is_set: np.ndarray) -> Picture:
    """White where it holds, else black."""
    return np.repeat(np.where(is_set, np.uint8(255), np.uint8(0))[..., None], 3, axis=2)


def with_fluid(picture: Picture, is_fluid: np.ndarray) -> Picture:
    """A picture with fluid exactly where it should be, and white where it has some but should not."""
    expected = np.where(shows_fluid(picture)[..., None], np.uint8(255), picture)
    expected[is_fluid] = srgb_bytes(FLUID_COLOR)
    return expected
