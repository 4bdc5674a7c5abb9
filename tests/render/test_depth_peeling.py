"""What only depth peeling can get wrong: its optimisations, its lists, and what the graphics processor sets limits to."""

from __future__ import annotations

import ctypes
from dataclasses import fields, replace

import numpy as np
import pytest
from judge import compare, judge
from scenes import SCENES, Scene

import meniscus
from meniscus.addon.fluid.camera import Region
from meniscus.addon.fluid.errors import DeviceError
from meniscus.addon.fluid.kernels import POLYNOMIAL_KERNELS
from meniscus.gpu_shaders.capture import Capture
from meniscus.gpu_shaders.methods.depth_peeling import groups, targets
from meniscus.gpu_shaders.methods.depth_peeling.options import Options
from meniscus.gpu_shaders.occlusion import OcclusionQuery
from meniscus.gpu_shaders.step import Step

SWITCHES = [field.name for field in fields(Options) if field.default is True]
# Deep lists, large and small balls, hidden ones, rays that start inside, carving.
OPTION_SCENES = [
    "lattice_with_droplets",
    "random_5000",
    "radii_over_six_orders",
    "eye_behind_kernel_sphere",
    "negative_weights",
]


@pytest.fixture
def depth_peeling(monkeypatch, opengl):
    """Renders with depth peeling made with other arguments than usual."""
    from meniscus.gpu_shaders.methods.depth_peeling import method

    def render(scene, camera, passes=("depth", "normal"), **arguments):
        monkeypatch.setattr(method, "create", lambda: method.DepthPeeling(opengl, **arguments))
        return meniscus.render(scene.balls, camera, scene.field, method="depth_peeling", passes=passes)

    return render


@pytest.mark.slow
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("scene_name", OPTION_SCENES)
@pytest.mark.parametrize("switch", SWITCHES)
def test_switching_an_optimisation_off_leaves_the_image_exact(switch, scene_name, projection, depth_peeling):
    scene = SCENES[scene_name]()
    camera = scene.camera(projection)
    image = depth_peeling(scene, camera, options=Options(**{switch: False}))
    judge(image, scene, camera)


def test_each_optimisation_spares_work(depth_peeling, monkeypatch):
    # Small groups, so that some are wholly hidden.
    monkeypatch.setattr(groups, "LEAST_BALLS", 16)
    scene = SCENES["lattice_with_droplets"]()
    camera = replace(scene.camera("perspective"), width=320, height=240)

    def counts(**switches):
        return depth_peeling(scene, camera, options=Options(diagnostics=True, **switches)).info.counts

    best = counts()
    assert best["balls_kept"] < 0.7 * best["balls"]
    assert counts(kernel_spheres=False)["balls_kept"] == best["balls"]
    assert counts(kernel_spheres=False)["pairs"] > best["pairs"]
    groups_only = counts(ball_culling=False)["balls_kept"]
    assert best["balls_kept"] < groups_only < best["balls"]
    assert counts(ball_culling=False, group_queries=False)["balls_kept"] == best["balls"]
    assert counts(tiling=False)["balls_kept"] > best["balls_kept"]
    assert 2.0 < best["bezier_iterations"] / best["bezier_solves"] < 3.0
    assert best["bezier_iterations_max"] < 15


@pytest.mark.parametrize("kernel", POLYNOMIAL_KERNELS)
@pytest.mark.parametrize("scene_name", ["ten_balls", "negative_weights", "eye_inside_fluid"])
def test_rays_whose_lists_are_too_short_arrive_all_the_same(scene_name, kernel, depth_peeling):
    scene = replace(SCENES[scene_name](), field=meniscus.Field(kernel, 0.25))
    camera = scene.camera("perspective")
    image = depth_peeling(scene, camera, list_length=1)
    assert image.info.counts["overflows"] > 100
    judge(image, scene, camera)


@pytest.mark.slow
@pytest.mark.parametrize("scene_name", ["ten_balls", "coincident_balls", "lattice_with_droplets", "eye_inside_fluid"])
def test_lists_that_overflow_leave_the_image_exact(scene_name, depth_peeling):
    scene = SCENES[scene_name]()
    camera = scene.camera("perspective")
    image = depth_peeling(scene, camera, list_length=2)
    assert image.info.counts["overflows"] > 100
    judge(image, scene, camera)


def test_rays_that_walk_end_at_the_far_clip_distance(depth_peeling):
    scene = replace(SCENES["ten_balls"](), clip_end=3.6)
    camera = scene.camera("perspective")
    image = depth_peeling(scene, camera, list_length=1)
    assert image.info.counts["overflows"] > 100
    judge(image, scene, camera)


def test_pairs_that_do_not_fit_make_their_buffer_grow(depth_peeling, monkeypatch):
    monkeypatch.setattr(targets, "FIRST_PAIRS", 1)
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    image = depth_peeling(scene, camera)
    assert image.info.counts["pairs"] > image.info.counts["balls"]
    judge(image, scene, camera)


@pytest.mark.parametrize("limit", [40, 96])
def test_images_wider_than_a_viewport_are_drawn_in_parts(limit, depth_peeling, pretend_limits):
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    whole = depth_peeling(scene, camera)
    pretend_limits(viewport_size=limit)
    in_parts = depth_peeling(scene, camera)
    judge(in_parts, scene, camera)
    np.testing.assert_array_equal(in_parts.hit, whole.hit)


def test_images_wider_than_a_texture_are_drawn_in_parts(depth_peeling, pretend_limits):
    scene = SCENES["ten_balls"]()
    camera = replace(scene.camera("orthographic"), width=5000, height=3)
    whole = depth_peeling(scene, camera)
    pretend_limits(texture_size=4096)
    in_parts = depth_peeling(scene, camera)
    assert 0.1 < whole.hit.mean() < 0.9
    np.testing.assert_array_equal(in_parts.hit, whole.hit)
    np.testing.assert_allclose(in_parts["depth"], whole["depth"], rtol=1e-5)


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"draw_buffers": 3}, "4 render targets at once are needed"),
        ({"texture_size": 1024}, "Textures of 4096 texels a side are needed"),
    ],
)
def test_a_context_that_takes_too_little_is_an_error(limits, message, depth_peeling, pretend_limits):
    scene = SCENES["one_ball"]()
    pretend_limits(**limits)
    with pytest.raises(DeviceError, match=message):
        depth_peeling(scene, scene.camera("perspective"))


def test_more_pairs_than_a_buffer_takes_are_an_error(depth_peeling, monkeypatch, pretend_limits):
    monkeypatch.setattr(targets, "FIRST_PAIRS", 1)
    pretend_limits(texture_buffer_size=10)
    scene = SCENES["ten_balls"]()
    with pytest.raises(DeviceError, match="parts of balls are in the view"):
        depth_peeling(scene, scene.camera("perspective"))


def test_calls_of_opengl_grow_neither_with_balls_nor_with_pixels(depth_peeling, monkeypatch):
    called = []

    def count_calls(owner, name):
        function = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *arguments: (called.append(name), function(*arguments))[1])

    for owner, name in ((Step, "draw"), (Capture, "points"), (OcclusionQuery, "asked")):
        count_calls(owner, name)

    def calls(count, width):
        """The balls lie in one plane, so that there are as many passes whatever their number."""
        called.clear()
        side = round(count**0.5)
        x, z = np.unravel_index(np.arange(side**2), (side, side))
        positions = np.stack([x, np.zeros_like(x), z], axis=1) / side - 0.5
        scene = Scene(meniscus.Balls(positions, 0.8 / side), view_height=1.2)
        depth_peeling(scene, replace(scene.camera("orthographic"), width=width, height=width))
        return len(called)

    assert calls(40_000, 512) <= calls(100, 64) + groups.MAX_GROUPS + 20


def many_balls_on_one_pixel(weight: float, count: int) -> Scene:
    """Balls that all lie over one another around a point, some of them exactly in the same place."""
    positions = np.random.default_rng(11).normal(0, 1e-3, (count, 3))
    positions[::2] = 0
    # Where the ray of a pixel of 1/12 passes.
    positions += [1 / 24, 0, 1 / 24]
    return Scene(meniscus.Balls(positions, 0.03, np.full(count, weight)), view_height=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("weight", [1.0, 0.5e-6])
def test_a_million_balls_on_one_pixel(weight, depth_peeling):
    """With the lesser weight no ball is a kernel sphere, and the surface is where nearly half of them have been met."""
    scene = many_balls_on_one_pixel(weight, 1_000_000)
    camera = replace(scene.camera("perspective"), width=32, height=24)
    image = depth_peeling(scene, camera)
    expected = meniscus.render(scene.balls, camera, scene.field, method="tile_caster")
    np.testing.assert_array_equal(image.hit, expected.hit)
    assert np.count_nonzero(image.hit) == 1
    np.testing.assert_allclose(image["depth"][image.hit], expected["depth"][image.hit], atol=3e-5)


@pytest.mark.parametrize("kind", ["Query", "Texture", "Buffer", "Framebuffer"])
def test_frames_leave_nothing_behind_in_opengl(kind, opengl):
    is_one = opengl.function(f"glIs{kind}", ctypes.c_uint, result=ctypes.c_ubyte)
    scene = SCENES["long_lists"]()

    def count_after(width):
        camera = replace(scene.camera("perspective"), width=width, height=8)
        image = meniscus.render(scene.balls, camera, scene.field, method="depth_peeling")
        assert image.info.counts["overflows"] > 0
        return opengl.run(lambda: sum(is_one(name) for name in range(1, 10_000)))

    count_after(20)
    first = count_after(21)
    assert first > 0
    assert [count_after(20), count_after(21)] == [first, first]


def test_diagnostics_of_a_ball_that_no_ray_meets(depth_peeling):
    # Smaller than a pixel, and between the rays of two.
    scene = Scene(meniscus.Balls([[0, 0, 0]], 0.01))
    camera = replace(scene.camera("orthographic"), width=2, height=1)
    image = depth_peeling(scene, camera, options=Options(diagnostics=True))
    assert image.info.counts["balls_drawn"] == 1
    assert image.info.counts["balls_kept"] == 0
    assert not image.hit.any()


def test_all_balls_around_the_eye_are_entered_where_rays_start(depth_peeling):
    # In this corner of a long lens' view single precision rounds the start of every ray up.
    positions = np.random.default_rng(1).normal(0, 0.05, (12, 3))
    scene = Scene(meniscus.Balls(positions, 1.0, weights=np.full(12, 0.06)))
    camera = meniscus.Camera.perspective(
        (0, 0, 0), (0, 1, 0), fov_y=0.0006474176732563575, width=64, height=64, clip_start=0.3791574282732325
    )
    corner = replace(camera, region=Region(56, 56, 64, 64)).cropped()
    image = depth_peeling(scene, corner)
    assert image.info.counts["peels"] > 12
    judge(image, scene, corner)


@pytest.mark.parametrize("switch", ["diagnostics", "group_queries"])
def test_nothing_is_read_where_it_is_drawn(switch, opengl, depth_peeling, monkeypatch):
    """llvmpipe forgives it, others then read what was there before."""
    read: dict = {}
    clashes: set = set()
    use_textures, draw, points = Step.use_textures, Step.draw, Capture.points

    def note(step, textures):
        read.clear()
        read.update({name: textures.get(name) or step.textures[name] for name in step._units})
        use_textures(step, textures)

    def compare(framebuffer, output=None):
        written = [*framebuffer.color_attachments, framebuffer.depth_attachment, output]
        for name, texture in read.items():
            if texture in written or (output and getattr(texture, "buffer", None) is output):
                clashes.add(name)

    def drawn(step, framebuffer, *arguments):
        draw(step, framebuffer, *arguments)
        compare(framebuffer)

    def captured(capture, array, ranges, output):
        # Although nothing is drawn into it.
        compare(opengl.gl.fbo, output)
        return points(capture, array, ranges, output)

    for owner, name, function in ((Step, "use_textures", note), (Step, "draw", drawn), (Capture, "points", captured)):
        monkeypatch.setattr(owner, name, function)
    for scene_name in ("long_lists", "negative_weights"):
        scene = SCENES[scene_name]()
        camera = replace(scene.camera("perspective"), width=32, height=24)
        depth_peeling(scene, camera, options=replace(Options(), **{switch: not getattr(Options(), switch)}))
    assert read
    assert clashes == set()


def test_walks_do_not_end_before_a_steep_ball(depth_peeling):
    # Where a linear kernel begins its slope is all there at once; with such a weight safe steps towards it are tiny.
    balls = meniscus.Balls([[-0.1, 0, 0], [0.1, 0, 0], [0, 0.4, 0]], [1.0, 1.0, 0.5], weights=[0.09, 0.09, 1e6])
    scene = Scene(balls, field=meniscus.Field("power_1", 0.2), view_height=0.8)
    camera = scene.camera("orthographic")
    image = depth_peeling(scene, camera, list_length=1)
    assert image.info.counts["overflows"] > 1000
    verdict = compare(image, scene, camera)
    assert verdict.compared > 1000
    assert not verdict.wrong
