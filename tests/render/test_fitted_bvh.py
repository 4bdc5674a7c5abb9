"""What Fitted BVH does beside what every method must."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest
from judge import expected, judge
from scenes import SCENES, Scene

import meniscus
from meniscus.addon.fluid.errors import CancelledError, DeviceError
from meniscus.addon.render import renderer
from meniscus.addon.render.fitted_bvh import FittedBvh
from meniscus.addon.render.tree_builder import TREES
from meniscus.gpu_shaders.methods.fitted_bvh import method
from meniscus.gpu_shaders.tree_constants import GREATEST_DEPTH

MEMORIES = pytest.mark.parametrize("with_storage", [False, True], ids=["textures", "storage"])
INNER = 2**32 - 1


@pytest.fixture
def use(monkeypatch, opengl):
    """Has the registry give a method that was made with certain arguments."""

    def use(**arguments):
        made = method.FittedBvhMethod(opengl, **arguments)
        monkeypatch.setattr(method, "create", lambda: made)
        return made

    return use


def image_of(scene, camera, passes=("depth", "normal")):
    return meniscus.render(scene.balls, camera, scene.field, method="fitted_bvh", passes=passes)


def depth_of(nodes: np.ndarray) -> int:
    """Inner nodes above the deepest leaf."""
    links, counts = nodes[:, [3, 7]].view(np.uint32).T
    level, depth = np.array([0]), 0
    while (inner := level[counts[level] == INNER]).size:
        level, depth = np.concatenate([inner + 1, links[inner]]), depth + 1
    return depth


@MEMORIES
@pytest.mark.parametrize("name", ["random_5000", "far_from_origin", "long_lists", "negative_weights", "kernel_power_1"])
def test_both_kinds_of_memory_give_the_surface(use, name, with_storage):
    use(with_storage=with_storage)
    scene = SCENES[name]()
    camera = scene.camera("perspective")
    judge(image_of(scene, camera), scene, camera)


@MEMORIES
@pytest.mark.parametrize("name", ["random_5000", "eye_inside_fluid", "negative_weights"])
def test_a_tree_whose_nodes_overlap_gives_the_same_surface(use, name, with_storage):
    use(hierarchy="overlapping", with_storage=with_storage)
    scene = SCENES[name]()
    camera = scene.camera("perspective")
    judge(image_of(scene, camera), scene, camera)


@MEMORIES
def test_what_the_balls_carry_is_that_of_the_cpu(use, with_storage):
    use(with_storage=with_storage)
    random = np.random.default_rng(4)
    positions = random.random((500, 3)) * 2 - 1
    weights = random.random(500) + 0.5
    balls = meniscus.Balls(positions, 0.3, weights, random.random((500, 3)), 10 * positions, np.arange(500)[::-1] + 7)
    camera = Scene(balls).camera("perspective")
    passes = ("depth", "color", "velocity", "ball_id")
    found, wanted = (
        meniscus.render(balls, camera, meniscus.Field(), method=name, passes=passes) for name in ("fitted_bvh", "tile_caster")
    )
    same = found.hit & wanted.hit & (np.abs(found["depth"] - wanted["depth"]) < 1e-4)
    assert same.sum() > 0.999 * wanted.hit.sum()
    np.testing.assert_allclose(found["color"][same], wanted["color"][same], atol=1e-3)
    np.testing.assert_allclose(found["velocity"][same], wanted["velocity"][same], atol=1e-2)
    assert np.mean(found["ball_id"][same] == wanted["ball_id"][same]) > 0.998


def nested_balls() -> Scene:
    """Balls that shrink towards the eye, so that box lies in box, and a ray that enters one has all larger ones before it."""
    scales = 0.6 ** np.arange(45)
    turn = 2.4 * np.arange(45)
    positions = scales[:, None] * np.stack([0.3 * np.cos(turn), np.ones(45), 0.3 * np.sin(turn)], axis=1)
    clusters = positions[:, None] + 0.1 * scales[:, None, None] * np.random.default_rng(8).normal(size=(45, 24, 3))
    balls = meniscus.Balls(clusters.reshape(-1, 3), np.repeat(0.06 * scales, 24))
    return Scene(balls, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), view_height=1.0, clip_start=1e-11)


@MEMORIES
def test_a_deep_tree_loses_nothing(use, with_storage):
    """The stack has room for the deepest tree that is built."""
    use(with_storage=with_storage)
    scene = nested_balls()
    assert 20 < depth_of(FittedBvh(scene.balls, scene.field).arrays().nodes) <= GREATEST_DEPTH
    camera = replace(scene.camera("perspective"), width=48, height=36)
    judge(image_of(scene, camera), scene, camera)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_an_eye_far_away_sees_as_well(projection):
    """So far that the depths have no digits left; normals tell where rays have hit."""
    scene = replace(SCENES["random_5000"](), eye=(3e5, -8e5, 2e5), clip_start=1.0, clip_end=1e7)
    camera = scene.camera(projection)
    want = expected(scene.balls, scene.field, camera)
    image = image_of(scene, camera)
    hit, should_hit = image.hit.ravel(), np.isfinite(want.t)
    assert np.count_nonzero(hit != should_hit) <= 2
    both = hit & should_hit
    cosines = np.einsum("ij,ij->i", image["normal"].reshape(-1, 3)[both], want.normals[both])
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 0.5


def test_the_tree_stays_while_the_balls_do(use):
    made = use()
    scene = SCENES["ten_balls"]()
    first = image_of(scene, scene.camera("perspective"))
    tree, buffers = made._tree, made._buffers
    again = image_of(scene, scene.camera("orthographic"))
    assert "build" in first.info.milliseconds
    assert "build" not in again.info.milliseconds
    assert made._tree is tree
    assert made._buffers is buffers
    moved = replace(scene, balls=meniscus.Balls(scene.balls.positions + 0.1, scene.balls.radii))
    judge(image_of(moved, moved.camera("perspective")), moved, moved.camera("perspective"))
    assert made._tree is not tree


def test_a_tree_that_was_cancelled_is_built_the_next_time(use):
    made = use()
    scene = SCENES["random_5000"]()
    camera = scene.camera("perspective")
    with pytest.raises(CancelledError):
        meniscus.render(scene.balls, camera, scene.field, method="fitted_bvh", is_cancelled=lambda: True)
    assert made._buffers is None
    judge(image_of(scene, camera), scene, camera)


@MEMORIES
def test_a_tree_that_does_not_fit_is_told(use, pretend_limits, with_storage):
    use(with_storage=with_storage)
    scene = SCENES["random_5000"]()
    pretend_limits(texture_buffer_size=1000, storage_block_bytes=16000)
    with pytest.raises(DeviceError, match="choose another method"):
        image_of(scene, scene.camera("perspective"))


def test_an_image_larger_than_a_texture_is_made_of_parts(pretend_limits, use):
    scene = SCENES["random_5000"]()
    camera = scene.camera("perspective")
    use()
    pretend_limits(texture_size=40)
    judge(image_of(scene, camera), scene, camera)


@MEMORIES
@pytest.mark.parametrize("radii", [1e-20, 1e20, [1e20, 0.5, 1e-20], [0.5, 1e-20, 0.5]])
def test_radii_beyond_all_reason(use, radii, with_storage):
    use(with_storage=with_storage)
    balls = meniscus.Balls([[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], radii)
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=32, height=24)
    found, wanted = (meniscus.render(balls, camera, meniscus.Field(), method=name) for name in ("fitted_bvh", "tile_caster"))
    np.testing.assert_array_equal(found.hit, wanted.hit)


@MEMORIES
def test_all_balls_at_one_point(use, with_storage):
    """More than a stretch of a ray has room for."""
    use(with_storage=with_storage)
    balls = meniscus.Balls(np.zeros((300, 3)), 1.0, np.linspace(0.001, 0.03, 300))
    scene = Scene(balls)
    camera = replace(scene.camera("perspective"), width=48, height=36)
    judge(image_of(scene, camera), scene, camera)


def test_the_tree_of_the_next_frame_is_made_ready(monkeypatch):
    """What was begun beforehand is used, and not built again."""
    scene, asked = SCENES["random_5000"](), []
    build = TREES._build

    def note_and_build(balls, *further):
        asked.append(balls)
        return build(balls, *further)

    monkeypatch.setattr(TREES, "_build", note_and_build)
    renderer.prepare(scene.balls, scene.field, "fitted_bvh", "auto")
    judge(image_of(scene, scene.camera("perspective")), scene, scene.camera("perspective"))
    assert [balls is scene.balls for balls in asked] == [True]


@pytest.mark.parametrize("flags", [moderngl.BLEND, moderngl.DEPTH_TEST | moderngl.BLEND, moderngl.CULL_FACE])
def test_what_others_have_left_switched_on_changes_nothing(opengl, use, flags):
    use(with_storage=False)
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    whole = image_of(scene, camera)
    opengl.run(lambda: opengl.gl.enable_only(flags))
    np.testing.assert_array_equal(image_of(scene, camera)["depth"], whole["depth"])
