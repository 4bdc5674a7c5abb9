"""Surface particles as the points of a mesh: live, in renders, and baked."""

import importlib
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from fluid_scenes import add_geometry_nodes, add_points, input_error, read_balls, store

RANDOM = np.random.default_rng(1)
POINTS = RANDOM.random((40, 3)).astype(np.float32)
RADIUS = 0.25
SPEED = 2.0
"""Of the fluid that moves along x, Blender units a second."""
LAST = 25
STEPS = 10
"""Of repulsion, what a mesh has at first."""

_ATTRIBUTES = {"position": "vector", "surface_normal": "vector", "velocity": "vector", "radius": "value", "id": "value"}


@pytest.fixture
def module(meniscus):
    """A module of addon.blender by its name."""
    return lambda name: importlib.import_module(f"{meniscus.__name__}.addon.blender.{name}")


@pytest.fixture
def scene(empty_scene):
    empty_scene.render.fps = 24
    empty_scene.frame_start, empty_scene.frame_end = 1, 4
    return empty_scene


@pytest.fixture
def fluid(scene):
    """A fluid that moves along x, and knows how fast."""
    item = add_points(scene.collection, "Fluid", POINTS, RADIUS)
    store(item.data, "velocity", "FLOAT_VECTOR", "vector", np.tile((SPEED, 0, 0), (len(POINTS), 1)))
    for frame in (1, LAST):
        item.location = ((frame - 1) * SPEED / scene.render.fps, 0, 0)
        item.keyframe_insert("location", frame=frame)
    for curve in curves_of(item):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    scene.frame_set(1)
    return item


def curves_of(item):
    action = item.animation_data.action
    return action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves


@pytest.fixture
def mesh(fluid):
    return add_particles()


def add_particles(count=400):
    assert bpy.ops.meniscus.surface_particles_add(particles=count) == {"FINISHED"}
    return bpy.context.view_layer.objects.active.data


def values(mesh, name="position"):
    """An attribute of all points."""
    attribute = mesh.attributes[name]
    found = np.empty(
        len(attribute.data) * (3 if _ATTRIBUTES[name] == "vector" else 1), np.int32 if name == "id" else np.float32
    )
    attribute.data.foreach_get(_ATTRIBUTES[name], found)
    return found.reshape(-1, 3) if _ATTRIBUTES[name] == "vector" else found


def all_values(mesh):
    return {name: values(mesh, name) for name in _ATTRIBUTES}


def assert_same_values(mesh, expected):
    for name, column in all_values(mesh).items():
        np.testing.assert_array_equal(column, expected[name], name)


def middle(mesh):
    return values(mesh)[:, 0].mean()


def on_surface(meniscus, mesh, balls=None):
    """The share of the points that lie on the surface of the balls as they are read now."""
    balls = read_balls(meniscus) if balls is None else balls
    positions, normals = values(mesh), values(mesh, "surface_normal")
    field = meniscus.Field(bpy.context.scene.meniscus.kernel, bpy.context.scene.meniscus.isovalue)
    t, _ = meniscus.oracle.cast(balls, field, positions + 0.01 * normals, -normals)
    return np.mean(np.abs(t - 0.01) < 1e-3)


def test_the_points_are_the_surface_particles_of_the_same_balls(meniscus, module, scene, mesh):
    particles = meniscus.SurfaceParticles(400, steps=STEPS)
    particles.seed(read_balls(meniscus), module("read_scene").read_field(scene))
    cloud = particles.cloud
    assert len(mesh.vertices) == 400
    expected = {"position": cloud.positions, "surface_normal": cloud.normals, "velocity": cloud.velocities}
    assert_same_values(mesh, {**expected, "radius": cloud.spacings / 2, "id": cloud.ids})


def test_there_are_as_many_as_the_surface_asks_for(meniscus, fluid):
    small = len(add_particles(0).vertices)
    fluid.meniscus.radius_factor = 0.5
    bpy.context.view_layer.update()
    large = len(add_particles(0).vertices)
    assert 100 < small < large


def test_particles_follow_the_fluid_and_keep_their_ids(meniscus, scene, mesh):
    before = all_values(mesh)
    scene.frame_set(2)
    assert on_surface(meniscus, mesh) > 0.99
    _, first, second = np.intersect1d(before["id"], values(mesh, "id"), return_indices=True)
    assert len(first) > 300
    moved = values(mesh)[second] - before["position"][first]
    np.testing.assert_allclose(np.median(moved, axis=0), (SPEED / 24, 0, 0), atol=0.02)


def test_a_jump_begins_anew(meniscus, scene, mesh):
    before = values(mesh, "id")
    scene.frame_set(LAST)
    assert on_surface(meniscus, mesh) > 0.99
    assert not np.intersect1d(before, values(mesh, "id")).size


def test_a_fluid_at_rest_keeps_its_particles(scene, fluid, mesh):
    fluid.animation_data_clear()
    scene.frame_set(2)
    before = all_values(mesh)
    for frame in (3, LAST):
        scene.frame_set(frame)
        assert_same_values(mesh, before)


def move(item):
    item.animation_data_clear()
    item.location = (0, 0, 3)


@pytest.mark.parametrize(
    "change",
    [
        move,
        lambda item: setattr(item.meniscus, "radius_factor", 0.8),
        lambda _: setattr(bpy.context.scene.meniscus, "isovalue", 0.4),
        lambda _: setattr(bpy.context.scene.meniscus, "kernel", "quartic"),
    ],
    ids=["moved", "radius", "isovalue", "kernel"],
)
def test_a_change_of_the_fluid_is_seen(meniscus, fluid, mesh, change):
    change(fluid)
    bpy.context.view_layer.update()
    assert on_surface(meniscus, mesh) > 0.99


@pytest.mark.parametrize(("name", "value"), [("particles", 100), ("seed", 7), ("steps", 0), ("disperses", False)])
def test_a_change_of_a_setting_is_seen(meniscus, mesh, name, value):
    before = values(mesh)
    setattr(mesh.meniscus, name, value)
    bpy.context.view_layer.update()
    assert not np.array_equal(values(mesh), before)
    assert on_surface(meniscus, mesh) > 0.99


def test_what_is_not_live_stays(scene, mesh):
    before = all_values(mesh)
    mesh.meniscus.use_live = False
    scene.frame_set(3)
    assert_same_values(mesh, before)
    mesh.meniscus.use_live = True
    bpy.context.view_layer.update()
    assert middle(mesh) == pytest.approx(before["position"][:, 0].mean() + 2 * SPEED / 24, abs=0.03)


def test_updates_come_to_rest(module, scene, fluid, mesh, monkeypatch):
    particles = module("surface_particles")
    written, read = [], []
    put, go_to = particles.put_particles, particles.FollowedFluid.go_to
    monkeypatch.setattr(particles, "put_particles", lambda *given: written.append(1) or put(*given))
    monkeypatch.setattr(particles.FollowedFluid, "go_to", lambda *given, **named: read.append(1) or go_to(*given, **named))
    scene.frame_set(2)
    assert (len(written), len(read)) == (1, 1)
    for _ in range(5):
        bpy.context.view_layer.update()
    assert (len(written), len(read)) == (1, 1)
    move(fluid)
    for _ in range(5):
        bpy.context.view_layer.update()
    assert (len(written), len(read)) == (2, 2)


def test_geometry_nodes_have_the_particles_of_the_frame(scene, mesh):
    item = bpy.context.view_layer.objects.active
    add_geometry_nodes(item, "GeometryNodeMeshToPoints", "GeometryNodePointsToVertices")
    scene.frame_set(3)
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    found = np.empty(3 * len(evaluated.vertices), np.float32)
    evaluated.attributes["position"].data.foreach_get("vector", found)
    np.testing.assert_array_equal(found.reshape(-1, 3), values(mesh))
    assert evaluated.attributes["id"].data_type == "INT"


def test_two_scenes_do_not_wake_each_other_for_ever(module, scene, mesh, monkeypatch):
    particles = module("surface_particles")
    written, put = [], particles.put_particles
    monkeypatch.setattr(particles, "put_particles", lambda *given: written.append(1) or put(*given))
    other = bpy.data.scenes.new("Other")
    for item in scene.objects:
        other.collection.objects.link(item)
    other.frame_set(3)
    assert middle(mesh) == pytest.approx(expected_middle(3), abs=0.07)

    def update(rounds):
        for _ in range(rounds):
            scene.view_layers[0].update()
            other.view_layers[0].update()

    update(4)
    settled = len(written)
    update(4)
    assert 2 <= len(written) == settled


def test_a_copy_of_the_scene_has_particles_of_its_own(meniscus, scene, mesh):
    bpy.ops.scene.new(type="FULL_COPY")
    copy = bpy.context.scene
    assert copy != scene
    own = next(item.data for item in copy.objects if item.data.meniscus.use_surface_particles)
    assert own != mesh
    before = all_values(mesh)
    copy.frame_set(3)
    assert_same_values(mesh, before)
    assert middle(own) == pytest.approx(middle(mesh) + 2 * SPEED / 24, abs=0.03)


def test_the_particles_are_no_fluid(meniscus, module, scene, fluid, mesh):
    item = bpy.context.view_layer.objects.active
    assert "surface particles" in module("sources").problem_of(item)
    assert bpy.ops.meniscus.add_sources() == {"CANCELLED"}
    item.meniscus.use_fluid = True
    bpy.context.view_layer.update()
    assert len(read_balls(meniscus)) == len(POINTS)
    scene.frame_set(2)
    assert on_surface(meniscus, mesh) > 0.99


def test_undo_and_redo(meniscus, fluid, module):
    bpy.ops.ed.undo_push(message="Before")
    mesh = add_particles()
    bpy.ops.ed.undo_push(message="Add Surface Particles")
    mesh.meniscus.particles = 150
    bpy.context.view_layer.update()
    assert len(mesh.vertices) == 150
    bpy.ops.ed.undo_push(message="Count")
    bpy.ops.ed.undo()
    bpy.context.view_layer.update()
    mesh = bpy.data.meshes["Surface Particles"]
    assert (mesh.meniscus.particles, len(mesh.vertices)) == (400, 400)
    bpy.ops.ed.redo()
    bpy.context.view_layer.update()
    mesh = bpy.data.meshes["Surface Particles"]
    assert (mesh.meniscus.particles, len(mesh.vertices)) == (150, 150)
    assert on_surface(meniscus, mesh) > 0.99
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    assert "Surface Particles" not in bpy.data.meshes
    bpy.context.scene.frame_set(3)


def test_undo_brings_no_particles_of_before(meniscus, module, fluid, mesh):
    bpy.ops.ed.undo_push(message="Before")
    # In the interface Blender evaluates only after what was done can be undone; here at once.
    with module("surface_particles").CLOUDS.resting(mesh.session_uid):
        move(fluid)
        bpy.ops.ed.undo_push(message="Move")
    fluid.update_tag()
    bpy.context.view_layer.update()
    assert on_surface(meniscus, mesh) > 0.99
    bpy.ops.ed.undo_push(message="Nothing")
    bpy.ops.ed.undo()
    bpy.context.view_layer.update()
    assert on_surface(meniscus, bpy.data.meshes["Surface Particles"]) > 0.99


def test_save_and_load(meniscus, mesh, tmp_path):
    mesh.meniscus.seed = 5
    bpy.context.view_layer.update()
    before = all_values(mesh)
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    mesh = bpy.data.meshes["Surface Particles"]
    assert (mesh.meniscus.use_surface_particles, mesh.meniscus.particles, mesh.meniscus.seed) == (True, 400, 5)
    assert_same_values(mesh, before)
    bpy.context.scene.frame_set(4)
    assert on_surface(meniscus, mesh) > 0.99


def test_without_the_extension_the_particles_are_simply_a_mesh(meniscus, scene, mesh):
    before = all_values(mesh)
    meniscus.unregister()
    try:
        scene.frame_set(3)
        assert_same_values(mesh, before)
    finally:
        meniscus.register()
    scene.frame_set(4)
    assert on_surface(meniscus, mesh) > 0.99


def test_an_old_file_is_brought_up_to_date_with_its_particles(meniscus, module, mesh, tmp_path):
    version_update, path = module("version_update"), str(tmp_path / "file.blend")
    bpy.app.handlers.save_pre.remove(version_update._mark)
    try:
        bpy.context.scene.meniscus.version = 0
        bpy.ops.wm.save_as_mainfile(filepath=path)
    finally:
        bpy.app.handlers.save_pre.append(version_update._mark)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bpy.context.scene.meniscus.version == version_update.CURRENT_VERSION
    bpy.context.scene.frame_set(2)
    assert on_surface(meniscus, bpy.data.meshes["Surface Particles"]) > 0.99


def test_without_a_fluid_none_can_be_added(scene):
    with pytest.raises(RuntimeError, match="use an object as fluid first"):
        bpy.ops.meniscus.surface_particles_add()


def test_a_fluid_that_goes_takes_its_particles_with_it(module, fluid, mesh, capfd):
    fluid.meniscus.use_fluid = False
    bpy.context.view_layer.update()
    assert len(mesh.vertices) == 0
    problem = module("surface_particles").CLOUDS.problem_of(mesh)
    assert problem.startswith("No object supplies balls")
    assert problem in capfd.readouterr().err
    fluid.meniscus.use_fluid = True
    bpy.context.view_layer.update()
    assert len(mesh.vertices) == 400
    assert module("surface_particles").CLOUDS.problem_of(mesh) == ""


def test_no_ball_and_no_surface_are_told(module, fluid, mesh):
    bpy.context.scene.meniscus.isovalue = 1e9
    bpy.context.view_layer.update()
    assert len(mesh.vertices) == 0
    assert "lower the isovalue" in module("surface_particles").CLOUDS.problem_of(mesh)
    bpy.context.scene.meniscus.isovalue = 0.2
    fluid.hide_render = True
    bpy.context.view_layer.update()
    assert "no ball" in module("surface_particles").CLOUDS.problem_of(mesh)
    fluid.hide_render = False
    bpy.context.view_layer.update()
    assert len(mesh.vertices) == 400


def test_a_fluid_that_cannot_be_read_leaves_the_particles_as_they_are(module, fluid, mesh):
    before = all_values(mesh)
    fluid.meniscus.radius_mode, fluid.meniscus.radius_attribute = "ATTRIBUTE", "missing"
    bpy.context.view_layer.update()
    assert_same_values(mesh, before)
    assert "missing" in module("surface_particles").CLOUDS.problem_of(mesh)


def test_kernels_that_particles_cannot_take_are_told(module, scene, mesh):
    scene.meniscus.kernel = "mishima"
    bpy.context.view_layer.update()
    assert "polynomial" in module("surface_particles").CLOUDS.problem_of(mesh)
    scene.meniscus.kernel = "wyvill"
    bpy.context.view_layer.update()
    assert module("surface_particles").CLOUDS.problem_of(mesh) == ""
    before = values(mesh, "id")
    scene.frame_set(2)
    assert len(np.intersect1d(before, values(mesh, "id"))) > 300


def test_velocities_that_are_not_finite_are_left_out(fluid):
    velocities = np.tile((SPEED, 0, 0), (len(POINTS), 1)).astype(np.float32)
    velocities[::2] = np.nan
    fluid.data.attributes["velocity"].data.foreach_set("vector", velocities.ravel())
    fluid.data.update()
    found = values(add_particles(), "velocity")
    assert np.isfinite(found).all()
    assert 0.2 * SPEED < np.median(found[:, 0]) < 0.8 * SPEED


# Renders


def draw_particles(item, size=0.05):
    """Let an object's points be drawn as little shining spheres."""
    group, (instance,) = add_geometry_nodes(item, "GeometryNodeInstanceOnPoints")
    sphere = group.nodes.new("GeometryNodeMeshIcoSphere")
    sphere.inputs["Radius"].default_value = size
    shine = bpy.data.materials.new("Shine")
    shine.use_nodes = True
    shine.node_tree.nodes.clear()
    emission = shine.node_tree.nodes.new("ShaderNodeEmission")
    shine.node_tree.links.new(emission.outputs[0], shine.node_tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    paint = group.nodes.new("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = shine
    group.links.new(sphere.outputs["Mesh"], paint.inputs["Geometry"])
    group.links.new(paint.outputs[0], instance.inputs["Instance"])


def look_from_above(scene, folder):
    """A Cycles render of 4 x 2 units from x = -0.5 on, 20 pixels a unit, to files."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    camera.location = (1.5, 0.5, 5.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.device = 1, False, "CPU"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 80, 40, 100
    scene.render.film_transparent = True
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGBA"
    scene.render.filepath = str(folder / "frame_")


def middle_of_picture(path):
    """Where along x, in Blender units, the picture shows anything on average."""
    picture = bpy.data.images.load(str(path), check_existing=False)
    width, height = picture.size
    alpha = np.array(picture.pixels, np.float32).reshape(height, width, 4)[..., 3]
    bpy.data.images.remove(picture)
    assert alpha.max() > 0.5, "nothing is seen"
    return (np.arange(width) + 0.5) @ alpha.sum(axis=0) / alpha.sum() / 20 - 0.5


def expected_middle(frame):
    return 0.5 + (frame - 1) * SPEED / 24


def test_each_frame_of_an_animation_shows_its_own_particles(scene, mesh, tmp_path):
    draw_particles(bpy.context.view_layer.objects.active)
    look_from_above(scene, tmp_path)
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 21, 10
    bpy.ops.render.render(animation=True)
    found = [middle_of_picture(tmp_path / f"frame_{frame:04}.png") for frame in (1, 11, 21)]
    np.testing.assert_allclose(found, [expected_middle(frame) for frame in (1, 11, 21)], atol=0.07)


def test_a_still_shows_the_particles_of_its_frame(scene, mesh, tmp_path):
    draw_particles(bpy.context.view_layer.objects.active)
    look_from_above(scene, tmp_path)
    scene.frame_set(17)
    scene.render.filepath += "17"
    bpy.ops.render.render(write_still=True)
    assert middle_of_picture(tmp_path / "frame_17.png") == pytest.approx(expected_middle(17), abs=0.07)


def test_the_command_line_renders_the_particles_of_its_frame(meniscus, scene, mesh, tmp_path):
    draw_particles(bpy.context.view_layer.objects.active)
    look_from_above(scene, tmp_path)
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    if bpy.app.binary_path:
        command = [bpy.app.binary_path, "--background", path, "--render-frame", "15"]
    else:
        script = (
            f"import sys, bpy; sys.path.insert(0, {str(Path(meniscus.__file__).parents[1])!r}); import meniscus\n"
            f"meniscus.register(); bpy.ops.wm.open_mainfile(filepath={path!r})\n"
            "bpy.context.scene.frame_start = bpy.context.scene.frame_end = 15; bpy.ops.render.render(animation=True)\n"
        )
        command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert middle_of_picture(tmp_path / "frame_0015.png") == pytest.approx(expected_middle(15), abs=0.07)


def test_only_what_renders_show_counts_in_the_background(module, scene, fluid, mesh, tmp_path):
    hidden = add_points(scene.collection, "Hidden", POINTS + (1.5, 0, 0), RADIUS)
    hidden.hide_render = True
    bpy.context.view_layer.update()
    assert middle(mesh) == pytest.approx(expected_middle(1), abs=0.07)
    # A graph of the viewport holds nothing of what is hidden there, a render's does.
    fluid.hide_set(True)
    bpy.context.view_layer.update()
    assert "hidden in the viewport only" in module("surface_particles").CLOUDS.problem_of(mesh)
    draw_particles(bpy.context.view_layer.objects.active)
    look_from_above(scene, tmp_path)
    scene.frame_set(9)
    scene.render.filepath += "9"
    bpy.ops.render.render(write_still=True)
    assert middle_of_picture(tmp_path / "frame_9.png") == pytest.approx(expected_middle(9), abs=0.07)


# Bakes


@pytest.fixture
def bake(mesh, tmp_path):
    """Bakes frames 1 to 4 and gives the folder."""
    folder = tmp_path / "cloud"
    mesh.meniscus.bake_folder = str(folder)

    def run(**options):
        return bpy.ops.meniscus.surface_particles_bake(**options)

    run.folder = folder
    return run


def files_in(folder):
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def test_a_bake_shows_what_was_live(meniscus, module, scene, mesh, bake):
    particles, field, expected = meniscus.SurfaceParticles(400, steps=STEPS), module("read_scene").read_field(scene), {}
    for frame in range(1, 5):
        scene.frame_set(frame)
        if frame == 1:
            particles.seed(read_balls(meniscus), field)
        else:
            particles.follow(read_balls(meniscus), field, frame * (1 / 24) - (frame - 1) * (1 / 24))
        expected[frame] = particles.cloud
    scene.frame_set(2)
    assert bake() == {"FINISHED"}
    assert files_in(bake.folder) == [f"Surface Particles_000{frame}.ply".replace(" ", "_") for frame in range(1, 5)]
    assert scene.frame_current == 2
    for frame in (4, 1, 3, 2):
        scene.frame_set(frame)
        cloud = expected[frame]
        columns = {"position": cloud.positions, "surface_normal": cloud.normals, "velocity": cloud.velocities}
        assert_same_values(mesh, {**columns, "radius": cloud.spacings / 2, "id": cloud.ids})


def test_frames_beyond_a_bake_show_its_ends_and_times_between_frames_move_on(scene, mesh, bake):
    bake()
    scene.frame_set(4)
    last = all_values(mesh)
    scene.frame_set(10)
    assert_same_values(mesh, last)
    scene.frame_set(2)
    second = all_values(mesh)
    scene.frame_set(2, subframe=0.25)
    np.testing.assert_allclose(values(mesh), second["position"] + 0.25 / 24 * second["velocity"], atol=1e-5)
    scene.frame_set(1, subframe=0.75)
    np.testing.assert_allclose(values(mesh), second["position"] - 0.25 / 24 * second["velocity"], atol=1e-5)


def test_a_bake_needs_no_fluid_any_more(scene, fluid, mesh, bake, tmp_path):
    bake()
    scene.frame_set(3)
    third = all_values(mesh)
    bpy.data.objects.remove(fluid)
    path = str(tmp_path / "file.blend")
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.context.scene.frame_set(3)
    assert_same_values(bpy.data.meshes["Surface Particles"], third)


@pytest.mark.parametrize("link", [True, False])
def test_a_bake_can_be_appended_and_cannot_be_linked(module, scene, mesh, bake, tmp_path, link):
    bake()
    scene.frame_set(3)
    third = all_values(mesh)
    scene.frame_set(1)
    first = all_values(mesh)
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=link) as (_, wanted):
        wanted.objects = ["Surface Particles"]
    bpy.context.scene.collection.objects.link(bpy.data.objects["Surface Particles"])
    bpy.context.scene.frame_set(3)
    mesh = bpy.data.meshes["Surface Particles"]
    assert_same_values(mesh, first if link else third)
    assert ("append it" in module("surface_particles").CLOUDS.problem_of(mesh)) == link


def test_a_freed_bake_is_live_again(meniscus, scene, mesh, bake):
    bake()
    scene.frame_set(4)
    assert bpy.ops.meniscus.surface_particles_free() == {"FINISHED"}
    assert not bake.folder.exists()
    assert on_surface(meniscus, mesh) > 0.99
    scene.frame_set(LAST)
    assert on_surface(meniscus, mesh) > 0.99
    with pytest.raises(RuntimeError, match="baked"):
        bpy.ops.meniscus.surface_particles_free()


def test_freeing_leaves_what_others_put_into_the_folder(mesh, bake):
    bake()
    (bake.folder / "mine.ply").write_text("mine")
    bpy.ops.meniscus.surface_particles_free()
    assert files_in(bake.folder) == ["mine.ply"]


def test_a_bake_lies_beside_the_file_by_default(mesh, tmp_path):
    with pytest.raises(RuntimeError, match="save that first"):
        bpy.ops.meniscus.surface_particles_bake()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "file.blend"))
    assert bpy.ops.meniscus.surface_particles_bake() == {"FINISHED"}
    assert len(files_in(tmp_path / "surface_particles")) == 4
    assert mesh.meniscus.baked_files.startswith("//")


def test_a_bake_that_fails_leaves_nothing(module, scene, fluid, mesh, bake, monkeypatch):
    operators = module("particle_operators")
    write, error = operators.write_particles, module("baked_particles").write_points
    output_error = importlib.import_module(error.__module__).OutputError

    def fail_at_last(path, cloud):
        if path.stem.endswith("3"):
            raise output_error("The disk is full")
        write(path, cloud)

    monkeypatch.setattr(operators, "write_particles", fail_at_last)
    scene.frame_set(2)
    with pytest.raises(RuntimeError, match="The disk is full"):
        bake()
    assert files_in(bake.folder) == []
    assert (mesh.meniscus.baked_files, scene.frame_current) == ("", 2)


def test_a_bake_that_is_cancelled_leaves_nothing(meniscus, module, scene, mesh, bake):
    before = all_values(mesh)
    run = module("particle_operators")._Bake(bpy.context, mesh, range(1, 5))
    assert run.advance()
    assert run.advance()
    assert len(files_in(bake.folder)) == 2
    assert_same_values(mesh, before)
    run.give_up()
    assert run.outcome[0] == "WARNING"
    assert files_in(bake.folder) == []
    assert (mesh.meniscus.baked_files, scene.frame_current) == ("", 1)
    scene.frame_set(2)
    assert on_surface(meniscus, mesh) > 0.99


def test_an_interrupted_bake_leaves_nothing(module, mesh, bake, monkeypatch):
    def interrupt(_path, _cloud):
        raise KeyboardInterrupt

    run = module("particle_operators")._Bake(bpy.context, mesh, range(1, 5))
    run.advance()
    monkeypatch.setattr(module("particle_operators"), "write_particles", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run.advance()
    assert files_in(bake.folder) == []


def test_a_mesh_that_is_removed_ends_its_bake(module, mesh, bake):
    run = module("particle_operators")._Bake(bpy.context, mesh, range(1, 5))
    run.advance()
    bpy.data.meshes.remove(mesh)
    assert not run.advance()
    assert "removed" in run.outcome[1]
    assert files_in(bake.folder) == []


def test_a_bake_of_no_frame_and_one_without_a_fluid_are_refused(scene, fluid, mesh, bake):
    with pytest.raises(RuntimeError, match="no frame from 5 to 3"):
        bake(frame_start=5, frame_end=3)
    fluid.meniscus.radius_mode, fluid.meniscus.radius_attribute = "ATTRIBUTE", "missing"
    with pytest.raises(RuntimeError, match="missing"):
        bake()
    assert files_in(bake.folder) == []
    fluid.meniscus.use_fluid = False
    with pytest.raises(RuntimeError, match="use an object as fluid first"):
        bake()


def test_a_file_that_is_gone_or_broken_is_told(module, scene, mesh, bake):
    bake()
    before = all_values(mesh)
    path = bake.folder / "Surface_Particles_0002.ply"
    whole = path.read_bytes()
    clouds = module("surface_particles").CLOUDS
    for content, reason in ((None, "no such file"), (whole[:-1], "not whole"), (b"rubbish", "not a binary PLY")):
        path.unlink() if content is None else path.write_bytes(content)
        scene.frame_set(2)
        assert reason in clouds.problem_of(mesh)
        assert_same_values(mesh, before)
        scene.frame_set(1)
    path.write_bytes(whole)
    scene.frame_set(2)
    assert clouds.problem_of(mesh) == ""


def test_blender_reads_a_bake_by_itself(mesh, bake):
    bake()
    expected = all_values(mesh)
    bpy.ops.wm.ply_import(filepath=str(bake.folder / "Surface_Particles_0001.ply"), forward_axis="Y", up_axis="Z")
    imported = bpy.context.view_layer.objects.active.data
    np.testing.assert_array_equal(values(imported), expected["position"])
    for name in ("radius", "vx"):
        found = np.empty(len(imported.vertices), np.float32)
        imported.attributes[name].data.foreach_get("value", found)
        np.testing.assert_array_equal(found, expected["radius"] if name == "radius" else expected["velocity"][:, 0])


def test_input_errors_are_the_extensions_own(meniscus, module, mesh):
    with pytest.raises(input_error(meniscus)):
        module("particle_operators")._Bake(bpy.context, mesh, range(2, 2))
