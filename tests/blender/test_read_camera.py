"""The camera is Blender's: projections of points agree with Blender's own over a grid of settings."""

import importlib
import itertools
import math

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix, Vector

TYPES = ("PERSP", "ORTHO")
SENSOR_FITS = ("AUTO", "HORIZONTAL", "VERTICAL")
RESOLUTIONS = ((640, 400), (400, 640))
PIXEL_ASPECTS = ((1.0, 1.0), (2.0, 1.0), (1.0, 1.5))
SHIFTS = ((0.0, 0.0), (0.3, -0.7))
GRID = list(itertools.product(TYPES, SENSOR_FITS, RESOLUTIONS, PIXEL_ASPECTS, SHIFTS))


def read_camera(meniscus, *arguments, **options):
    reader = importlib.import_module(meniscus.__name__ + ".addon.blender.read_camera")
    return reader.read_camera(bpy.context.evaluated_depsgraph_get(), *arguments, **options)


def input_error(meniscus):
    return importlib.import_module(meniscus.__name__ + ".addon.fluid.errors").InputError


def add_camera(scene, kind="PERSP"):
    data = bpy.data.cameras.new("Camera")
    data.type = kind
    data.lens, data.sensor_width, data.sensor_height, data.ortho_scale = 40.0, 36.0, 20.0, 7.0
    data.clip_start, data.clip_end = 0.25, 80.0
    camera = bpy.data.objects.new("Camera", data)
    camera.location, camera.rotation_euler, camera.scale = (3.0, -4.0, 2.0), (1.1, 0.2, 0.6), (2.0, 0.5, 3.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 640, 400
    return camera


def random_points(camera_object, count=200):
    """World-space points in front of the camera, in its image and around it."""
    bpy.context.view_layer.update()
    generator = np.random.default_rng(7)
    depth = generator.uniform(1.0, 30.0, count)
    spread = generator.uniform(-1.0, 1.0, (count, 2)) * depth[:, None]
    rigid = np.array(camera_object.matrix_world.normalized())
    return np.column_stack((spread, -depth)) @ rigid[:3, :3].T + rigid[:3, 3]


def projected(camera, points):
    """Normalized device coordinates x, y and planar depth of world-space points."""
    view = np.column_stack((points, np.ones(len(points)))) @ camera.view_from_world.T
    clip = view @ camera.clip_from_view.T
    return np.column_stack((clip[:, :2] / clip[:, 3:], -view[:, 2]))


def projected_by_blender(scene, camera_object, points):
    frame = np.array([world_to_camera_view(scene, camera_object, Vector(point)) for point in points])
    return np.column_stack((2 * frame[:, :2] - 1, frame[:, 2]))


def assert_same_projection(camera, scene, camera_object):
    points = random_points(camera_object)
    expected = projected_by_blender(scene, camera_object, points)
    np.testing.assert_allclose(projected(camera, points), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(("kind", "sensor_fit", "resolution", "pixel_aspect", "shift"), GRID, ids=str)
def test_points_project_as_blender_projects_them(meniscus, empty_scene, kind, sensor_fit, resolution, pixel_aspect, shift):
    camera_object = add_camera(empty_scene, kind)
    camera_object.data.sensor_fit = sensor_fit
    camera_object.data.shift_x, camera_object.data.shift_y = shift
    render = empty_scene.render
    render.resolution_x, render.resolution_y = resolution
    render.pixel_aspect_x, render.pixel_aspect_y = pixel_aspect
    camera = read_camera(meniscus)
    assert (camera.width, camera.height) == resolution
    assert camera.pixel_aspect == pixel_aspect[0] / pixel_aspect[1]
    assert camera.is_perspective == (kind == "PERSP")
    assert_same_projection(camera, empty_scene, camera_object)


@pytest.mark.parametrize("kind", TYPES)
def test_pixels_have_the_aspect_of_the_scene(meniscus, empty_scene, kind):
    add_camera(empty_scene, kind)
    empty_scene.render.pixel_aspect_x = 1.5
    width, height = read_camera(meniscus).pixel_size
    assert width / height == pytest.approx(1.5, rel=1e-5)


def test_percentage_scales_the_image_and_keeps_the_view(meniscus, empty_scene):
    camera_object = add_camera(empty_scene)
    empty_scene.render.resolution_percentage = 50
    camera = read_camera(meniscus)
    assert (camera.width, camera.height) == (320, 200)
    assert_same_projection(camera, empty_scene, camera_object)


def test_odd_percentage_rounds_down_as_blender_does(meniscus, empty_scene):
    add_camera(empty_scene)
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 101, 77
    empty_scene.render.resolution_percentage = 33
    camera = read_camera(meniscus)
    assert (camera.width, camera.height) == (33, 25)


def test_given_resolution_replaces_that_of_the_scene(meniscus, empty_scene):
    camera_object = add_camera(empty_scene)
    empty_scene.render.resolution_percentage = 50
    camera = read_camera(meniscus, resolution=(300, 100))
    assert (camera.width, camera.height) == (300, 100)
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 300, 100
    assert_same_projection(camera, empty_scene, camera_object)


def test_given_camera_replaces_that_of_the_scene(meniscus, empty_scene):
    other = add_camera(empty_scene)
    other.location.x = 9.0
    add_camera(empty_scene)
    assert read_camera(meniscus, other).eye[0] == pytest.approx(9.0)
    assert read_camera(meniscus).eye[0] == pytest.approx(3.0)


def test_animated_camera_is_read_at_the_current_frame(meniscus, empty_scene):
    camera_object = add_camera(empty_scene)
    for frame, x, lens in ((1, 0.0, 20.0), (11, 10.0, 60.0)):
        camera_object.location.x, camera_object.data.lens = x, lens
        camera_object.keyframe_insert("location", frame=frame)
        camera_object.data.keyframe_insert("lens", frame=frame)
    widths = []
    for frame, x in ((1, 0.0), (11, 10.0)):
        empty_scene.frame_set(frame)
        camera = read_camera(meniscus)
        assert camera.eye[0] == pytest.approx(x, abs=1e-5)
        widths.append(camera.window.right - camera.window.left)
    assert widths[0] / widths[1] == pytest.approx(3.0, rel=1e-5)


def test_clip_distances_are_those_of_the_camera(meniscus, empty_scene):
    add_camera(empty_scene)
    camera = read_camera(meniscus)
    assert (camera.clip_start, camera.clip_end) == (0.25, 80.0)


def test_scale_of_the_camera_and_its_parent_does_not_count(meniscus, empty_scene):
    camera_object = add_camera(empty_scene)
    parent = bpy.data.objects.new("Parent", None)
    parent.scale = (3.0, 3.0, 3.0)
    empty_scene.collection.objects.link(parent)
    camera_object.parent = parent
    camera = read_camera(meniscus)
    axes = camera.world_from_view[:3, :3]
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert_same_projection(camera, empty_scene, camera_object)


def test_mirrored_camera_shows_the_mirrored_image_as_in_blender(meniscus, empty_scene):
    camera_object = add_camera(empty_scene)
    camera_object.scale.x = -1.0
    camera = read_camera(meniscus)
    assert np.linalg.det(camera.world_from_view) == pytest.approx(-1.0)
    assert_same_projection(camera, empty_scene, camera_object)


def test_border_without_crop_is_a_region_of_the_whole_image(meniscus, empty_scene):
    add_camera(empty_scene)
    render = empty_scene.render
    whole = read_camera(meniscus)
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1.0
    camera = read_camera(meniscus)
    assert camera.window == whole.window
    assert (camera.width, camera.height) == (640, 400)
    region = camera.region
    assert (region.x_min, region.y_min, region.x_max, region.y_max) == (160, 200, 480, 400)


def test_border_with_crop_is_the_whole_image(meniscus, empty_scene):
    add_camera(empty_scene)
    render = empty_scene.render
    whole = read_camera(meniscus)
    render.use_border, render.use_crop_to_border = True, True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1.0
    camera = read_camera(meniscus)
    assert camera.region is None
    assert (camera.width, camera.height) == (320, 200)
    np.testing.assert_allclose(camera.view_rays()[1], whole.view_rays()[1][200:400, 160:480], atol=1e-7)


def test_border_without_pixels_is_an_error(meniscus, empty_scene):
    add_camera(empty_scene)
    render = empty_scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.5, 0.5
    with pytest.raises(input_error(meniscus), match="render border"):
        read_camera(meniscus)


def test_scene_without_camera_is_an_error_that_names_the_scene(meniscus, empty_scene):
    with pytest.raises(input_error(meniscus), match=f"'{empty_scene.name}' has no camera"):
        read_camera(meniscus)


def test_object_that_is_no_camera_is_an_error(meniscus, empty_scene):
    empty = bpy.data.objects.new("Target", None)
    empty_scene.collection.objects.link(empty)
    with pytest.raises(input_error(meniscus), match="'Target' is not a camera"):
        read_camera(meniscus, empty)


def test_panoramic_camera_is_an_error(meniscus, empty_scene):
    add_camera(empty_scene, "PANO")
    with pytest.raises(input_error(meniscus), match="'Camera' is panoramic"):
        read_camera(meniscus)


def test_sheared_camera_is_an_error(meniscus, empty_scene):
    camera_object = add_camera(empty_scene)
    parent = bpy.data.objects.new("Parent", None)
    parent.scale = (3.0, 1.0, 1.0)
    empty_scene.collection.objects.link(parent)
    camera_object.parent = parent
    camera_object.matrix_basis = Matrix.Rotation(math.radians(30), 4, "Z")
    with pytest.raises(input_error(meniscus), match="sheared"):
        read_camera(meniscus)
