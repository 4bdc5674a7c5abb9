"""Settings of methods: from properties and from the command line to the renderer."""

import importlib
from dataclasses import replace

import bpy
import numpy as np
import pytest

LIMIT = 0.1
"""Not a number of 32 bits: a property holds a little more."""


def module(meniscus, name):
    return importlib.import_module(f"{meniscus.__name__}.addon.{name}")


@pytest.fixture
def known(meniscus):
    """Settings that the Tile Caster has in these tests."""
    setting = module(meniscus, "render.settings").Setting
    return (
        setting("width", "Width", "Width of a step", 0.05, 0.01, LIMIT),
        setting("count", "Count", "How many", 8, 1, 64),
        setting("use_bisection", "Bisection", "Whether to halve", True),
        setting("budget", "Budget", "Milliseconds of a frame", 0.0, 0.0, 1000.0, is_for_motion=True),
    )


@pytest.fixture
def scene(meniscus, known, empty_scene, monkeypatch):
    """A ball before a camera, to be rendered by the Tile Caster, which has settings."""
    params, properties = module(meniscus, "render.tile_caster.params"), module(meniscus, "blender.method_settings")
    properties.unregister()
    monkeypatch.setattr(params, "METHOD", replace(params.METHOD, settings=known))
    properties.register()
    mesh = bpy.data.meshes.new("Ball")
    mesh.from_pydata([(0, 0, 0)], [], [])
    source = bpy.data.objects.new("Ball", mesh)
    source.meniscus.use_fluid, source.meniscus.radius_mode = True, "FIXED"
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -6, 0), (np.pi / 2, 0, 0)
    for item in (source, camera):
        empty_scene.collection.objects.link(item)
    empty_scene.camera = camera
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 24, 16
    empty_scene.frame_start = empty_scene.frame_end = 1
    empty_scene.meniscus.method = "tile_caster"
    yield empty_scene
    properties.unregister()
    monkeypatch.undo()
    properties.register()


@pytest.fixture
def asked(meniscus, scene, monkeypatch):
    """The settings that the method got, one entry an image."""
    renderer = module(meniscus, "render.renderer")
    create, found = renderer.create_method, []

    class Recorder:
        def __init__(self, runner):
            self.runner, self.device = runner, runner.device

        def find_surface(self, request):
            found.append(dict(request.settings))
            return self.runner.find_surface(request)

    def create_recorded(name):
        info, runner = create(name)
        return info, Recorder(runner)

    monkeypatch.setattr(renderer, "create_method", create_recorded)
    return found


@pytest.fixture
def command(meniscus, scene, tmp_path, capsys):
    """Runs `--command meniscus render ARGUMENTS`; gives the status and what was said on the standard error."""

    def run(*arguments):
        output = ("render", "--output", str(tmp_path / "fluid.exr"))
        return module(meniscus, "blender.command_line").main([*output, *arguments]), capsys.readouterr().err

    return run


def own(scene):
    return scene.meniscus.method_settings.tile_caster


def test_properties_are_those_of_the_registry(scene, known):
    properties = own(scene).bl_rna.properties
    assert list(type(own(scene)).__annotations__) == [setting.name for setting in known]
    for setting in known:
        made = properties[setting.name]
        assert (made.name, made.description) == (setting.label, setting.description)
        assert made.default == pytest.approx(setting.default)
    assert (properties["count"].hard_min, properties["count"].hard_max) == (1, 64)
    assert properties["width"].hard_max == pytest.approx(LIMIT)


def test_settings_reach_the_method_from_properties(scene, asked, command):
    group = own(scene)
    group.width, group.count, group.use_bisection = LIMIT, 3, False
    assert command() == (0, "")
    assert asked == [{"width": LIMIT, "count": 3, "use_bisection": False, "budget": 0.0}]
    assert all(type(value) is type(known) for value, known in zip(asked[0].values(), (0.1, 3, False, 0.0), strict=True))


def test_settings_reach_the_method_from_the_command_line(scene, asked, command):
    own(scene).count, own(scene).width = 3, 0.0625
    assert command("--setting", "count=5", "--setting", "use_bisection=off") == (0, "")
    assert asked == [{"width": 0.0625, "count": 5, "use_bisection": False, "budget": 0.0}]


def test_what_holds_a_pace_counts_in_renders_only_where_the_command_line_says_so(scene, asked, command):
    own(scene).budget = 50.0
    assert command()[0] == command("--setting", "budget=20")[0] == 0
    assert [settings["budget"] for settings in asked] == [0.0, 20.0]


def test_the_settings_of_another_method_are_left_alone(scene, asked, command):
    own(scene).count = 3
    scene.meniscus.method = "auto"
    scene.meniscus.backend = "cpu"
    assert command() == (0, "")
    assert command("--method", "tile_caster") == (0, "")
    assert [settings["count"] for settings in asked] == [8, 3]


@pytest.mark.parametrize(
    ("arguments", "status", "sentence"),
    [
        (("--setting", "stride=1"), 1, "The method 'tile_caster' has no setting 'stride': it has width, count"),
        (("--setting", "count=0"), 1, "The setting 'count' cannot be 0: give a whole number from 1 to 64"),
        (("--setting", "count=many"), 1, "The setting 'count' cannot be 'many': give a whole number from 1 to 64"),
        (("--setting", "count"), 2, "'count' is no setting; write NAME=VALUE"),
        (("--method", "auto", "--setting", "count=1"), 1, "the method is automatic"),
        (("--method", "depth_peeling", "--setting", "count=1"), 1, "has no setting 'count': it has none"),
    ],
)
def test_wrong_settings_give_one_sentence(asked, command, arguments, status, sentence):
    result, said = command(*arguments)
    assert result == status
    assert sentence in said
    assert said.count("\n") == 1
    assert not asked


def test_pixels_that_a_method_leaves_out_are_told(meniscus, scene, command, monkeypatch):
    renderer = module(meniscus, "render.renderer")
    create = renderer.create_method

    class Unfinished:
        def __init__(self, runner):
            self.runner, self.device = runner, runner.device

        def find_surface(self, request):
            surface = self.runner.find_surface(request)
            surface.counts["unfinished"] = 12
            return surface

    monkeypatch.setattr(renderer, "create_method", lambda name: (create(name)[0], Unfinished(create(name)[1])))
    status, said = command()
    assert status == 0
    assert "12 pixels were left out because the method reached its limits there" in said


def test_settings_survive_saving_and_loading(scene, tmp_path):
    own(scene).count = 7
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "fluid.blend"), check_existing=False)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "fluid.blend"))
    assert own(bpy.context.scene).count == 7


def test_the_panel_shows_the_settings_of_the_chosen_method_alone(meniscus, scene):
    shown = []

    class Layout:
        def prop(self, _owner, name, **_):
            shown.append(name)

    panels = module(meniscus, "blender.panels")
    panels._draw_surface(Layout(), scene.meniscus)
    scene.meniscus.method = "auto"
    panels._draw_surface(Layout(), scene.meniscus)
    plain = ["display", "kernel", "isovalue", "method"]
    assert shown == [*plain, "width", "count", "use_bisection", "budget", "backend", *plain, "backend"]


def test_a_scene_that_only_shows_its_panel_still_never_saw_meniscus(meniscus, empty_scene):
    version_update = module(meniscus, "blender.version_update")
    empty_scene.meniscus.version = 0
    assert not version_update._was_used(empty_scene)
    _ = empty_scene.meniscus.method_settings.name  # reading makes the group
    assert not version_update._was_used(empty_scene)
