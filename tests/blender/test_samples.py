"""The sample scenes inside Blender, small ones: built, simulated, saved and read as balls."""

import importlib
import subprocess

import bpy
import numpy as np
import pytest


@pytest.fixture
def sample(meniscus):
    """Gives the samples' modules by name."""
    return lambda name: importlib.import_module(f"{meniscus.__name__}.samples.{name}")


@pytest.fixture
def read_balls(meniscus):
    """Gives the balls of the open scene at a frame."""
    module = importlib.import_module(f"{meniscus.__name__}.addon.blender.read_scene")

    def read(frame=1):
        bpy.context.scene.frame_set(frame)
        return module.read_fluid(bpy.context.evaluated_depsgraph_get()).balls

    return read


@pytest.mark.parametrize("name", ["block", "jets", "scattered"])
def test_points_come_through_blender_as_they_are(sample, empty_scene, read_balls, name):
    expected = sample(name).balls(200, seed=2)
    sample(name).build(empty_scene, count=200, seed=2)
    balls = read_balls()
    assert np.array_equal(balls.positions, expected.positions)
    assert np.array_equal(balls.radii, expected.radii)
    assert np.array_equal(balls.ids, expected.ids)
    assert empty_scene.camera is not None


def test_a_molecule_brings_its_colours_and_its_isovalue(sample, empty_scene, read_balls):
    molecule = sample("molecule")
    molecule.build(empty_scene)
    balls, expected = read_balls(), molecule.balls()
    assert np.array_equal(balls.positions, expected.positions)
    assert np.allclose(balls.colors, expected.colors)
    assert empty_scene.meniscus.isovalue == pytest.approx(molecule.ISOVALUE)
    assert share_in_view(empty_scene, balls.positions) == 1


def test_the_camera_sees_all_jets(sample, empty_scene, read_balls):
    sample("jets").build(empty_scene, count=2000)
    assert share_in_view(empty_scene, read_balls().positions) > 0.99


def test_argon_has_velocities_and_lies_in_front_of_the_camera(sample, empty_scene, read_balls, tmp_path, monkeypatch):
    monkeypatch.setattr(sample("store"), "FOLDER", tmp_path)
    monkeypatch.setattr(sample("argon"), "FRAMES", 2)
    monkeypatch.setattr(sample("argon"), "STEPS_A_FRAME", 20)
    sample("argon").build(empty_scene, count=400, frame=2)
    balls = read_balls()
    assert len(balls) == 400
    assert np.std(balls.velocities) > 0
    assert share_in_view(empty_scene, balls.positions) == 1


@pytest.fixture
def build_on_one_thread(sample, tmp_path):
    """Builds a sample where it is simulated the same way in every run, see one_thread.py, and opens it."""

    def build(name, **options):
        if not bpy.app.binary_path:  # the module has one thread for simulations
            sample(name).build(bpy.context.scene, **options)
            return
        path = tmp_path / f"{name}.blend"
        arguments = ["--output", str(path)]
        for option, value in options.items():
            arguments += [f"--{option.replace('_', '-')}", str(value)]
        package = sample(name).__package__
        script = f"from {package} import {name}, shell; raise SystemExit(shell.save_sample({name}.build, {arguments}))"
        command = [bpy.app.binary_path, "--background", "--threads", "1", "--python-exit-code", "1", "--python-expr", script]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert path.is_file(), done.stdout + done.stderr
        bpy.ops.wm.open_mainfile(filepath=str(path))

    return build


def test_the_dam_breaks_inside_its_tank_and_does_not_boil(sample, empty_scene, read_balls, build_on_one_thread):
    dam_break = sample("dam_break")
    build_on_one_thread("dam_break", spacing=0.12, frame_end=40)
    frames = [read_balls(frame) for frame in range(1, 41)]
    assert {len(balls) for balls in frames} == {len(frames[0])}
    every = np.stack([balls.positions for balls in frames])
    assert np.all(np.isfinite(every))
    length, depth, height = dam_break.TANK
    # Blender lets a particle dip into a wall for a moment; it must not get lost there.
    assert every.min() > -0.06
    assert np.all(every.max(axis=(0, 1)) < np.array([length, depth, 2 * height]) + 0.06)
    # The block stands still at first, every particle in a place of its own; then its front runs to the far wall.
    assert len(np.unique(every[0].round(4), axis=0)) == len(every[0])
    assert every[0, :, 0].max() < dam_break.WATER[0]
    assert every[:, :, 0].max() > length - 0.1
    # Water at rest has its weight at half the level; walls without particles let a little more in.
    resting_level = np.prod(dam_break.WATER) / (length * depth)
    assert 0.35 * resting_level < every[-1, :, 2].mean() < 0.7 * resting_level
    # All of the energy is that of the fall, and some of it is lost.
    fall = np.sqrt(9.81 * dam_break.WATER[2])
    speeds = [np.sqrt(np.mean(np.sum(balls.velocities**2, axis=1))) for balls in frames]
    assert 0.4 * fall < max(speeds) < fall
    assert speeds[-1] < 0.6 * max(speeds)


def test_the_dam_break_is_the_same_for_the_same_seed(sample, empty_scene, read_balls):
    def last_positions(seed):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        # So few that Blender takes one thread for them, see one_thread.py.
        sample("dam_break").build(bpy.context.scene, seed=seed, spacing=0.35, frame_end=12)
        return read_balls(12).positions

    first = last_positions(1)
    assert 30 < len(first) < 100
    assert np.array_equal(first, last_positions(1))
    assert not np.array_equal(first, last_positions(2))


def test_the_baked_dam_break_is_stored_with_its_simulation(sample, empty_scene, read_balls, tmp_path, monkeypatch):
    monkeypatch.setattr(sample("store"), "FOLDER", tmp_path)
    path = sample("dam_break").baked_file(spacing=0.15, frame_end=8)
    baked = read_balls(8)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert sample("dam_break").baked_file(spacing=0.15, frame_end=8) == path
    # It came from the store: the empty file is still open.
    assert not bpy.context.scene.objects
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert bpy.data.objects["Liquid"].particle_systems[0].point_cache.is_baked
    # Straight to the last frame: what was baked is read, nothing is simulated.
    again = read_balls(8)
    assert np.array_equal(again.positions, baked.positions)
    assert np.array_equal(again.velocities, baked.velocities)


def test_influence_radii_are_two_spacings(sample, empty_scene, read_balls):
    sample("dam_break").build(empty_scene, spacing=0.15, frame_end=2)
    assert np.allclose(read_balls(1).radii, 0.3)


def test_the_camera_sees_the_whole_dam_break(sample, empty_scene, read_balls):
    sample("dam_break").build(empty_scene, spacing=0.15, frame_end=30)
    for frame in (1, 15, 30):
        assert share_in_view(empty_scene, read_balls(frame).positions) > 0.99


def test_particles_of_the_fountain_are_born_rise_fall_and_die(sample, empty_scene, read_balls):
    fountain = sample("fountain")
    fountain.build(empty_scene, spacing=0.07, frame_end=75)
    counts = [len(read_balls(frame)) for frame in (5, 20, 50, 75)]
    assert counts[0] < counts[1] < counts[2]
    # As many die as are born from the first death on.
    assert counts[3] == pytest.approx(counts[2] * fountain.LIFETIME / 50, rel=0.1)
    balls = read_balls(50)
    heights, distances = balls.positions[:, 2], np.hypot(balls.positions[:, 0], balls.positions[:, 1])
    assert heights.max() > 2 * fountain.NOZZLE_HEIGHT
    assert heights.min() > -0.05
    assert np.any((heights < 0.2) & (distances > 2 * fountain.NOZZLE_RADIUS))


def test_a_sample_is_saved_from_the_shell(sample, empty_scene, tmp_path, capsys):
    path = tmp_path / "new" / "block.blend"
    assert sample("shell").save_sample(sample("block").build, ["--output", str(path), "--count", "123"]) == 0
    assert str(path) in capsys.readouterr().out
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert len(bpy.data.objects["Block"].data.vertices) == 123
    assert bpy.data.objects["Block"].meniscus.use_fluid


def test_a_sample_that_cannot_be_saved_says_so(sample, empty_scene, tmp_path, capsys):
    (tmp_path / "file").write_text("in the way")
    arguments = ["--output", str(tmp_path / "file" / "block.blend"), "--count", "10"]
    assert sample("shell").save_sample(sample("block").build, arguments) == 1
    assert "folder" in capsys.readouterr().err


def share_in_view(scene, positions):
    """The share of `positions` (N, 3) that the scene's camera sees."""
    bpy.context.view_layer.update()
    camera, render = scene.camera, scene.render
    projection = camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=render.resolution_x, y=render.resolution_y)
    clip_from_world = np.array(projection @ camera.matrix_world.inverted())
    clip = np.column_stack([positions, np.ones(len(positions))]) @ clip_from_world.T
    return np.mean(np.all(np.abs(clip[:, :2]) < clip[:, 3:], axis=1))


def test_the_dam_break_is_composited_over_cycles(sample, empty_scene, tmp_path):
    sample("dam_break").build(empty_scene, spacing=0.15, frame_end=2)
    composite = sample("composite")
    composite.furnish(empty_scene)
    empty_scene.render.resolution_percentage = 10
    composite.render(empty_scene, tmp_path / "picture.png", 2, 4)
    picture = bpy.data.images.load(str(tmp_path / "picture.png"))
    width, height = picture.size
    assert (width, height) == (128, 72)
    pixels = np.array(picture.pixels, np.float32).reshape(height, width, 4)
    red, blue = pixels[..., 0], pixels[..., 2]
    assert (blue > 3 * red).mean() > 0.05, "water"
    assert (red > 2 * blue).mean() > 0.01, "what stands in it and before it"


def test_foam_lies_where_the_water_is_fast_and_bubbles_stay_what_they_are(sample, empty_scene):
    sample("dam_break").build(empty_scene, spacing=0.12, frame_end=14)
    foam = sample("foam")
    empty_scene.frame_set(12)
    item = foam.add_foam(empty_scene, count=4000)
    sizes = []
    for frame in (12, 13):
        empty_scene.frame_set(frame)
        centers, radii = bubbles_of(item)
        points, ids = values_of(item.data, "position", "vector"), values_of(item.data, "id", "value")
        nearest = np.array([np.argmin(np.sum((points - center) ** 2, axis=1)) for center in centers])
        assert np.allclose(points[nearest], centers, atol=1e-4)
        speeds = np.linalg.norm(values_of(item.data, "velocity", "vector"), axis=1)
        assert 100 < len(centers) < len(points) / 2
        assert speeds[nearest].min() > foam.SLOW
        assert np.median(speeds[nearest]) > 1.2 * np.median(speeds)
        assert values_of(item.data, "surface_normal", "vector")[nearest, 2].min() > foam.STEEP
        assert foam.SIZES[0] - 1e-5 < radii.min() < np.median(radii) < 0.5 * sum(foam.SIZES)
        sizes.append(dict(zip(ids[nearest].tolist(), radii.tolist(), strict=True)))
    stayed = sizes[0].keys() & sizes[1].keys()
    assert len(stayed) > 50
    assert all(sizes[0][number] == pytest.approx(sizes[1][number], rel=1e-3) for number in stayed)


def bubbles_of(item):
    """Centres (N, 3) and radii (N,) of the icospheres that an object's nodes make."""
    data = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    corners = values_of(data, "position", "vector").reshape(-1, 42, 3)
    centers = corners.mean(axis=1)
    return centers, np.linalg.norm(corners - centers[:, None], axis=2).mean(axis=1)


def values_of(mesh, name, value):
    """An attribute on points."""
    data = mesh.attributes[name].data
    found = np.empty(len(data) * (3 if value == "vector" else 1), np.int32 if name == "id" else np.float32)
    data.foreach_get(value, found)
    return found.reshape(-1, 3) if value == "vector" else found


def test_foam_is_rendered_white_on_water(sample, empty_scene, tmp_path):
    sample("dam_break").build(empty_scene, spacing=0.15, frame_end=14)
    foam = sample("foam")
    foam.furnish(empty_scene, count=10_000)
    empty_scene.render.resolution_percentage = 10
    pictures = []
    for hidden in (False, True):
        empty_scene.objects["Foam"].hide_render = hidden
        foam.render(empty_scene, tmp_path / "picture.png", 14, 2)
        picture = bpy.data.images.load(str(tmp_path / "picture.png"), check_existing=False)
        pictures.append(np.array(picture.pixels, np.float32).reshape(-1, 4)[:, :3].min(axis=1))
        bpy.data.images.remove(picture)
    lighter, darker = (np.mean(sign * (pictures[0] - pictures[1]) > 0.15) for sign in (1, -1))
    assert lighter > 0.005
    assert darker < 0.2 * lighter
