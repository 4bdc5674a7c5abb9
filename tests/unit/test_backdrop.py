"""Meshes as a camera sees them, judged by formulas and by a ray caster in double precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.camera import Region, Window
from meniscus.addon.fluid.errors import CancelledError, InputError
from meniscus.addon.fluid.lighting import Light, Lighting, Material, WorldImage
from meniscus.addon.fluid.meshes import Meshes, MeshObject
from meniscus.addon.fluid.passes import DEPTH_BACKGROUND
from meniscus.addon.render.backdrop import Surroundings, backdrop
from meniscus.addon.render.surroundings import Motion

DARK = Lighting((), (0.0, 0.0, 0.0))


def perspective(**changes):
    camera = meniscus.Camera.perspective((0.3, -4, 1.5), (0, 0, 0.2), fov_y=0.8, width=61, height=45)
    return replace(camera, **changes)


def orthographic(**changes):
    camera = meniscus.Camera.orthographic((0.3, -4, 1.5), (0, 0, 0.2), scale=3.0, width=61, height=45)
    return replace(camera, **changes)


def shifted(camera):
    """The same camera with a lens shift, and pixels that are not square."""
    window = camera.window
    return replace(camera, window=Window(window.left + 0.3, window.right + 0.4, window.bottom - 0.1, window.top))


CAMERAS = {
    "perspective": perspective(),
    "perspective, shifted": shifted(perspective()),
    "perspective, close": perspective(clip_start=3.5, clip_end=4.5),
    "orthographic": orthographic(),
    "orthographic, shifted": shifted(orthographic()),
    "orthographic, close": orthographic(clip_start=3.5, clip_end=4.5),
}


@pytest.fixture(params=CAMERAS)
def camera(request):
    return CAMERAS[request.param]


def meshes_of(corners, normals=None, objects=None, materials=None):
    """Triangles (T, 3, 3), each with vertices of its own; of one object and one material where none are given."""
    corners = np.asarray(corners, np.float32)
    count = len(corners)
    if normals is None:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, None].repeat(3, axis=1)
    return Meshes(
        vertices=corners.reshape(-1, 3),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        normals=np.ascontiguousarray(normals, np.float32),
        object=np.zeros(count, np.int32) if objects is None else np.asarray(objects, np.int32),
        material=np.zeros(count, np.int32),
        objects=tuple(MeshObject(f"Object {number}", number) for number in range(1 + max(objects or [0]))),
        materials=materials or (Material(),),
    )


def seen(meshes, camera, **options):
    return backdrop(meshes, camera, DARK, (0, 0, 0, 0), **options)


def world_rays(camera):
    """Origins and directions (height, width, 3), world space; the distance along them is planar depth."""
    origins, directions = camera.view_rays()
    rotation = camera.world_from_view[:3, :3]
    return origins @ rotation.T + camera.eye, directions @ rotation.T


def cast(corners, camera):
    """(height, width): depths and nearest triangles, -1 for none; each ray against each triangle."""
    origins, directions = world_rays(camera)
    depth, nearest = np.full(origins.shape[:2], DEPTH_BACKGROUND), np.full(origins.shape[:2], -1)
    for index, (a, b, c) in enumerate(np.asarray(corners, np.float32).astype(np.float64)):
        normal = np.cross(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((a - origins) @ normal) / (directions @ normal)
            point = origins + t[..., None] * directions
            sides = [np.cross(end - start, point - start) @ normal for start, end in ((a, b), (b, c), (c, a))]
        is_nearer = (np.min(sides, axis=0) >= 0) & (t >= camera.clip_start) & (t <= camera.clip_end) & (t < depth)
        depth[is_nearer], nearest[is_nearer] = t[is_nearer], index
    return depth, nearest


def test_random_triangles_are_where_rays_meet_them(camera):
    """Also behind the eye, and from before it to behind it."""
    random = np.random.default_rng(2)
    corners = random.uniform((-3, -6, -2), (3, 3, 2), (80, 1, 3)) + random.normal(0, 0.8, (80, 3, 3))
    found = seen(meshes_of(corners, objects=list(range(80))), camera)
    depth, nearest = cast(corners, camera)
    assert (nearest >= 0).mean() > 0.1
    assert len(np.unique(nearest)) > 10
    np.testing.assert_array_equal(found.object, nearest)
    np.testing.assert_allclose(found.depth, depth, rtol=1e-6)
    facing = np.einsum("hwi,hwi->hw", found.normal, world_rays(camera)[1])
    assert (facing[nearest >= 0] < 0).all()
    assert not found.normal[nearest < 0].any()


def test_a_sphere_has_the_depth_and_normals_of_the_formula(camera):
    """With smooth normals; its facets lie within a sagitta of the sphere."""
    rings = 120
    polar = np.linspace(0, np.pi, rings + 1)[:, None]
    around = np.linspace(0, 2 * np.pi, 2 * rings + 1)
    points = np.stack(np.broadcast_arrays(np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)), -1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    corners = np.concatenate([np.stack([a, c, b], axis=2).reshape(-1, 3, 3), np.stack([b, c, d], axis=2).reshape(-1, 3, 3)])
    found = seen(meshes_of(corners, normals=corners), camera)
    origins, directions = world_rays(camera)
    square, half = np.einsum("hwi,hwi->hw", directions, directions), np.einsum("hwi,hwi->hw", directions, origins)
    inside = half**2 - square * (np.einsum("hwi,hwi->hw", origins, origins) - 1)
    for sign in (-1, 1):  # from outside, and where the clip start is in the sphere from within
        t = (-half + sign * np.sqrt(np.maximum(inside, 0))) / square
        is_first = (sign < 0) | ((-half - np.sqrt(np.maximum(inside, 0))) / square < camera.clip_start - 0.05)
        sure = (inside > 0.05) & is_first & (t > camera.clip_start + 0.05) & (t < camera.clip_end - 0.05)
        np.testing.assert_allclose(found.depth[sure], t[sure], atol=2e-3)
        points_hit = (origins + t[..., None] * directions)[sure]
        np.testing.assert_allclose(found.normal[sure], -sign * points_hit, atol=4e-3)
    assert (found.depth[inside < 0] == DEPTH_BACKGROUND).all()


def test_a_border_is_a_part_of_the_image(camera):
    random = np.random.default_rng(5)
    meshes = meshes_of(random.uniform(-1.5, 1.5, (30, 1, 3)) + random.normal(0, 0.5, (30, 3, 3)))
    whole = seen(meshes, camera)
    region = Region(7, 5, 40, 38)
    part = seen(meshes, replace(camera, region=region).cropped())
    inside = np.s_[region.y_min : region.y_max, region.x_min : region.x_max]
    is_same = part.object == whole.object[inside]
    assert is_same.mean() > 0.995  # the centres of pixels differ in the last digit
    np.testing.assert_allclose(part.depth[is_same], whole.depth[inside][is_same], rtol=1e-5)


def test_no_pixel_between_neighbours_is_empty(camera):
    """A wall of quadrilaterals whose edges run through centres of pixels."""
    across, up = (np.linspace(-20, 20, count) for count in (62, 46))
    rotation = camera.world_from_view[:3, :3]
    points = camera.eye + np.stack(np.meshgrid(across, up), -1) @ rotation[:, :2].T - 4 * rotation[:, 2]
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    corners = np.stack([a, b, c, d, c, b], axis=2).reshape(-1, 3, 3)
    found = seen(meshes_of(corners), camera)
    np.testing.assert_allclose(found.depth, 4, rtol=1e-5)


def test_holdouts_leave_holes_and_the_rest_is_shaded():
    camera = orthographic()
    wall = np.array([[(-1, 0, -1), (0, 0, -1), (0, 0, 1)], [(0, 0, -1), (1, 0, -1), (0, 0, 1)]], np.float32)
    meshes = meshes_of(wall, objects=[0, 1], materials=(Material(color=(0.25, 0.5, 0.75), roughness=1.0),))
    meshes = replace(meshes, objects=(MeshObject("Hole", 5, is_holdout=True), MeshObject("Wall", 6)))
    lighting = Lighting((Light("SUN", (3.0, 3.0, 3.0), direction=(0.0, 1.0, 0.0)),), (0.0, 0.0, 0.0))
    found = backdrop(meshes, camera, lighting, (1, 0, 1, 1))
    assert (found.names, found.pass_indices) == (("Hole", "Wall"), (5, 6))
    np.testing.assert_array_equal(found.is_holdout, found.object == 0)
    assert not found.rgba[found.object == 0].any()
    assert {*np.unique(found.object)} == {-1, 0, 1}
    np.testing.assert_array_equal(found.rgba[found.object == -1], [(1, 0, 1, 1)] * (found.object == -1).sum())
    shown = found.rgba[found.object == 1]
    assert (shown[:, 3] == 1).all()
    np.testing.assert_allclose(shown[:, :3] / shown[:, 2:3], [(1 / 3, 2 / 3, 1)] * len(shown), atol=0.1)
    np.testing.assert_array_equal(found.color[found.object == 1], [(0.25, 0.5, 0.75)] * len(shown))
    every = backdrop(meshes, camera, lighting, (1, 0, 1, 1), are_holdouts=True)
    assert not every.rgba[every.object >= 0].any()


def test_vertices_that_move_take_what_is_seen_along(camera):
    """By an affine transform every point moves as the corners do."""
    random = np.random.default_rng(8)
    meshes = meshes_of(random.uniform(-1.5, 1.5, (30, 1, 3)) + random.normal(0, 0.5, (30, 3, 3)))
    turn, move = random.normal(0, 0.5, (3, 3)), np.array((0.3, -0.2, 0.5))
    elsewhere = (meshes.vertices @ turn + move).astype(np.float32)
    found = seen(meshes, camera, motion=Motion(camera, camera, 1.0, None, elsewhere))
    origins, directions = world_rays(camera)
    is_seen = found.object >= 0
    assert is_seen.mean() > 0.1
    points = (origins + found.depth[..., None] * directions)[is_seen]
    np.testing.assert_allclose(found.to_following[is_seen], points @ turn + move - points, atol=1e-4)
    assert not found.to_following[~is_seen].any()
    assert found.to_previous is None
    assert seen(meshes, camera).to_following is None


def test_nothing_gives_the_background():
    nothing = meshes_of(np.empty((0, 3, 3)))
    found = backdrop(nothing, perspective(), DARK, (0.5, 0.25, 0.125, 1))
    assert (found.depth == DEPTH_BACKGROUND).all()
    assert (found.rgba == (0.5, 0.25, 0.125, 1)).all()


def test_cancelling_raises_what_the_caller_raised():
    given_up = CancelledError("given up")

    def give_up(_share: float) -> None:
        raise given_up

    with pytest.raises(CancelledError) as caught:
        seen(meshes_of(np.eye(3)[None]), perspective(), watch=give_up)
    assert caught.value is given_up


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"vertices": np.zeros((3, 3))}, r"vertices of meshes must be float32 of the shape \(3, 3\), not float64"),
        ({"triangles": np.array([[0, 1, 3]], np.int32)}, "An index in triangles of meshes is out of range"),
        ({"triangles": np.array([[0, 1, -1]], np.int32)}, "An index in triangles of meshes is out of range"),
        ({"normals": np.zeros((1, 3), np.float32)}, r"normals of meshes must be float32 of the shape \(1, 3, 3\)"),
        ({"object": np.array([1], np.int32)}, "An index in object of meshes is out of range"),
        ({"material": np.array([1], np.int32)}, "An index in material of meshes is out of range"),
        ({"material": np.zeros(2, np.int32)}, r"material of meshes must be int32 of the shape \(1,\)"),
    ],
)
def test_unusable_arrays_are_refused_with_a_sentence(changes, sentence):
    with pytest.raises(InputError, match=sentence):
        replace(meshes_of(np.eye(3)[None]), **changes)


def test_cameras_and_traced_light_meet_what_is_theirs():
    """With the numbers of objects and materials that all of them have; the background is a colour or the world's image."""
    front = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)]
    camera = meniscus.Camera.orthographic((0, 0, 5), (0, 0, 0), up=(0, 1, 0), scale=2.0, width=21, height=21)
    both = meshes_of([np.array(front), np.array(front) + (0, 0, 1)], objects=[0, 1])
    meshes = replace(both, objects=(replace(both.objects[0], is_traced=False), replace(both.objects[1], is_seen=False)))
    seen = Surroundings(meshes, DARK, is_film_clear=True).backdrop(camera)
    assert seen.depth[10, 10] == pytest.approx(5)
    assert seen.object[10, 10] == 0
    np.testing.assert_array_equal(seen.meshes.object, [1])
    assert seen.meshes.objects == meshes.objects
    assert seen.meshes is meshes.traced, "trees belong to one"
    nothing = Surroundings(meshes.unseen, DARK, is_film_clear=True).backdrop(camera)
    assert not nothing.is_seen.any()
    assert len(nothing.meshes) == 1
    assert Surroundings(None, DARK, is_film_clear=True).backdrop(camera) is None
    sky = WorldImage(np.full((4, 8, 3), 0.25, np.float32))
    world = Surroundings(meshes, Lighting((), sky.mean, sky), is_film_clear=False).backdrop(camera)
    np.testing.assert_allclose(world.rgba[20, 0], (0.25, 0.25, 0.25, 1))
    assert not world.is_film_clear
