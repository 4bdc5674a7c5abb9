"""Passes: the fluid together with what else is in the scene."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.lighting import FluidSource, Light, Lighting, Material
from meniscus.addon.fluid.passes import DEPTH_BACKGROUND, PASSES
from meniscus.addon.render.renderer import render
from meniscus.addon.render.surroundings import Backdrop, Motion

FIELD = meniscus.Field("quartic", 0.25)
CAMERA = meniscus.Camera.perspective((0, -5, 0), (0, 0, 0), fov_y=0.6, width=25, height=19)
CENTRE = (9, 12)
"""The pixel that looks at the origin."""


def balls(**columns):
    """Two balls whose surfaces have the radius 0.5: one at the origin, one beside it and farther away."""
    return meniscus.Balls([(0, 0, 0), (0.9, 1, 0)], 0.5 / np.sqrt(0.5), **columns)


def wall(depth, is_holdout=False):
    """A red wall across the image."""
    empty = Backdrop.empty(CAMERA)
    shape = empty.depth.shape
    return Backdrop(
        rgba=np.broadcast_to(np.array((0, 0, 0, 0) if is_holdout else (0.5, 0, 0, 1), np.float32), (*shape, 4)),
        depth=np.full(shape, depth, np.float32),
        normal=np.broadcast_to(np.array((0, -1, 0), np.float32), (*shape, 3)),
        color=np.broadcast_to(np.array((1, 0, 0), np.float32), (*shape, 3)),
        object=np.zeros(shape, np.int32),
        is_holdout=np.full(shape, is_holdout),
        names=("Wall",),
        pass_indices=(5,),
    )


def passes(backdrop=None, motion=None, **columns):
    look = meniscus.Look("flat", (0, 0, 1), sources=(FluidSource("A", 2), FluidSource("B", 3)))
    return render(
        balls(**{"sources": [0, 1]} | columns), CAMERA, FIELD, passes=tuple(PASSES), look=look, backdrop=backdrop, motion=motion
    )


def test_a_wall_behind_shows_where_no_fluid_is():
    image, alone = passes(wall(6.5)), passes()
    assert image.hit.all()
    fluid = alone.hit
    assert 0 < fluid.mean() < 0.9
    for name in ("depth", "normal", "position", "color", "object_index", "facing", "ball_id"):
        np.testing.assert_array_equal(image[name][fluid], alone[name][fluid], err_msg=name)
    assert set(image["object_index"][~fluid]) == {5}
    np.testing.assert_allclose(image["position"][~fluid][:, 1], 1.5, atol=1e-5)
    np.testing.assert_array_equal(image["color"][~fluid], [[1, 0, 0]] * np.count_nonzero(~fluid))
    np.testing.assert_array_equal(image["combined"][~fluid], [[0.5, 0, 0, 1]] * np.count_nonzero(~fluid))
    np.testing.assert_array_equal(image["velocity"][~fluid], 0)
    np.testing.assert_array_equal(image["ball_id"][~fluid], -1)


@pytest.mark.parametrize("is_holdout", [False, True])
def test_a_wall_between_the_balls_hides_the_farther_one(is_holdout):
    image = passes(wall(5.2, is_holdout))
    indices = set(np.unique(image["object_index"]))
    assert indices == ({0, 2} if is_holdout else {5, 2})
    hidden = image["object_index"] != 2
    assert image["combined"][CENTRE].tolist() == [0, 0, 1, 1]
    if is_holdout:
        for name in ("depth", "normal", "combined", "color"):
            np.testing.assert_array_equal(image[name][hidden], PASSES[name].background, err_msg=name)
        assert not image.hit[hidden].any()
        assert PASSES["depth"].background == DEPTH_BACKGROUND
    else:
        np.testing.assert_allclose(image["depth"][hidden], 5.2)


def test_fluid_that_is_held_out_leaves_a_hole_in_what_is_behind():
    sources = (FluidSource("A", 2, is_holdout=True), FluidSource("B", 3))
    image = render(
        balls(sources=[0, 1]), CAMERA, FIELD, passes=("combined", "depth"), look=meniscus.Look("flat", sources=sources),
        backdrop=wall(6.5),
    )  # fmt: skip
    assert image["combined"][CENTRE].tolist() == [0, 0, 0, 0]
    assert image["depth"][CENTRE] == DEPTH_BACKGROUND
    assert image["combined"][0, 0].tolist() == [0.5, 0, 0, 1]


def test_passes_of_motion():
    velocity = np.array((0.3, 0.6, -0.1), np.float32)
    previous, following = (
        replace(CAMERA, world_from_view=CAMERA.world_from_view + step * np.eye(4)[:, :1] * [[0, 0, 0, 1]])
        for step in (-0.2, 0.1)
    )
    image = passes(motion=Motion(previous, following, 0.5), velocities=[velocity, velocity])
    np.testing.assert_allclose(image["speed"][CENTRE], np.linalg.norm(velocity), rtol=1e-5)
    point = image["position"][CENTRE].astype(float)
    # A camera with a view of this height, at this distance, by hand.
    scale = CAMERA.height / (2 * np.tan(0.3))
    before, after = point - 0.5 * velocity, point + 0.5 * velocity
    now_x = point[0] / (point[1] + 5) * scale
    expected = (
        (before[0] + 0.2) / (before[1] + 5) * scale - now_x,
        before[2] / (before[1] + 5) * scale - point[2] / (point[1] + 5) * scale,
        now_x - (after[0] - 0.1) / (after[1] + 5) * scale,
        point[2] / (point[1] + 5) * scale - after[2] / (after[1] + 5) * scale,
    )
    np.testing.assert_allclose(image["vector"][CENTRE], expected, atol=1e-4)
    assert not image["vector"][~image.hit].any()


def test_other_objects_have_ways_of_their_own():
    """Where they are seen; fluid before them moves as the fluid does."""
    shape = (CAMERA.height, CAMERA.width, 3)
    back, on = np.full(shape, (0.2, 0, -0.1), np.float32), np.full(shape, (0, 0.5, 0.3), np.float32)
    still = Motion(CAMERA, CAMERA, 0.5)
    columns = {"velocities": [(0, 0, 0.4)] * 2}
    fluid = passes(motion=still, **columns)
    image = passes(replace(wall(6.5), to_previous=back, to_following=on), motion=still, **columns)
    np.testing.assert_array_equal(image["vector"][fluid.hit], fluid["vector"][fluid.hit])
    others = ~fluid.hit
    x, y, z = image["position"][others].astype(float).T
    scale = CAMERA.height / (2 * np.tan(0.3))
    expected = [0.2 / (y + 5), -0.1 / (y + 5), x / (y + 5) - x / (y + 5.5), z / (y + 5) - (z + 0.3) / (y + 5.5)]
    np.testing.assert_allclose(image["vector"][others], scale * np.transpose(expected), atol=1e-4)
    one_sided = passes(replace(wall(6.5), to_following=on), motion=still, **columns)["vector"][others]
    np.testing.assert_array_equal(one_sided[:, 2:], image["vector"][others][:, 2:])
    assert not one_sided[:, :2].any()
    hole = passes(replace(wall(6.5, is_holdout=True), to_previous=back), motion=still, **columns)
    assert not hole["vector"][others].any()


def test_facing_is_one_in_the_middle_and_falls_to_the_border():
    image = passes()
    assert image["facing"][CENTRE] > 0.9999
    assert image["facing"].min() == 0
    assert 0 < image["facing"][image.hit].min() < 0.5


def test_clear_materials_let_their_color_of_what_is_behind_pass():
    glass = Material(color=(1.0, 0.5, 0.0), transmission=1.0, roughness=0.0, ior=1.5)
    look = meniscus.Look("material", sources=(FluidSource(material=glass),), lighting=Lighting())
    backdrop = replace(wall(6.5), rgba=np.ones((19, 25, 4), np.float32))
    colors = np.broadcast_to(np.array(glass.color, np.float32), (2, 3))
    image = render(balls(colors=colors), CAMERA, FIELD, passes=("combined",), look=look, backdrop=backdrop)
    np.testing.assert_allclose(image["combined"][CENTRE], [0.96, 0.48, 0, 1], atol=0.01)
    unknown = render(balls(colors=colors), CAMERA, FIELD, passes=("combined",), look=look)["combined"][CENTRE]
    assert unknown[3] == pytest.approx(1 - 0.48, abs=0.01)
    assert unknown[0] > unknown[2]


def test_lights_stand_in_world_space():
    light = Light("POINT", (100.0, 50.0, 0.0), position=(0, -2, 0))
    dull = Material((1.0, 1.0, 1.0), roughness=1.0, ior=1.0)
    look = meniscus.Look("material", sources=(FluidSource(material=dull),), lighting=Lighting((light,)))
    white = np.ones((2, 3), np.float32)
    pixel = render(balls(colors=white), CAMERA, FIELD, passes=("combined",), look=look)["combined"][CENTRE]
    # The surface is 1.5 units before the light and faces it.
    radiance = 100 / (4 * np.pi * 1.5**2) / np.pi
    np.testing.assert_allclose(pixel, [radiance, radiance / 2, 0, 1], rtol=1e-4)


def test_images_are_given_back_at_once():
    """Not only when Python looks for cycles, which may be many images later."""
    gc.collect()
    gc.disable()
    try:
        image = passes(wall(6.5))
        seen = [weakref.ref(image[name]) for name in ("depth", "combined", "vector")]
        del image
        assert [reference() for reference in seen] == [None] * 3
    finally:
        gc.enable()
