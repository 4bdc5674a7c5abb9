"""Traced light, judged by closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.fluid.lighting import FluidSource, Light, Lighting, Material, WorldImage
from meniscus.addon.fluid.meshes import Meshes, MeshObject
from meniscus.addon.fluid.tracing import Tracing
from meniscus.addon.render.backdrop import backdrop
from meniscus.addon.render.surroundings import Backdrop

FIELD = meniscus.Field("wyvill", 0.2)
NO_BALLS = meniscus.Balls(np.empty((0, 3)), 1.0)
BALL = meniscus.Balls([[0.0, 0.0, 0.0]], 1.0)
RADIUS = float(FIELD.kernel_radii(np.ones(1), np.ones(1))[0])
PAIR = meniscus.Balls([[0.0, 0.0, 0.0], [0.9, 0.2, 0.3]], 1.0)
CAMERA = meniscus.Camera.perspective((0.3, -4.0, 1.0), (0.0, 0.0, 0.0), fov_y=0.5, width=48, height=36)
CLEAR = (0.0, 0.0, 0.0, 0.0)
WHITE = Lighting((), (1.0, 1.0, 1.0))
DULL = Material((1.0, 1.0, 1.0), roughness=1.0, ior=1.0)
GLASS = Material((1.0, 1.0, 1.0), transmission=1.0, roughness=0.0, ior=1.5)
MIRROR = Material((1.0, 1.0, 1.0), metallic=1.0, roughness=0.0)


def render(balls, material, lighting, tracing=None, camera=CAMERA, meshes=None, background=(0.0, 0.0, 0.0, 1.0), **more):
    """The traced image (height, width, 4), and where fluid is seen."""
    sources = (FluidSource(material=material),)
    look = meniscus.Look("material", color=material.color, sources=sources, lighting=lighting, tracing=tracing or Tracing())
    behind = Backdrop.empty(camera, background) if meshes is None else backdrop(meshes, camera, lighting, background)
    image = meniscus.render(
        balls, camera, FIELD, passes=("combined", "depth"), look=look, backend="cpu", backdrop=behind, **more
    )
    return image["combined"], image["depth"] < 1e9


def rays(camera):
    """Origin (3,) and unit directions (height, width, 3) of the rays of a perspective camera, float64."""
    _, directions = camera.view_rays()
    directions = directions @ camera.world_from_view[:3, :3].T
    return np.asarray(camera.eye), directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def sphere_hits(camera, radius=RADIUS, center=(0.0, 0.0, 0.0)):
    """Where rays meet a sphere first, and unit normals there: (height, width, 3) each, NaN where they miss."""
    eye, directions = rays(camera)
    away = eye - np.asarray(center)
    middle = -(directions @ away)
    with np.errstate(invalid="ignore"):
        t = middle - np.sqrt(radius**2 - (away @ away - middle**2))
    points = eye + t[..., None] * directions
    return points, (points - np.asarray(center)) / radius


def dot(a, b):
    return (a * b).sum(axis=-1, keepdims=True)


def mirrored(directions, normals):
    return directions - 2 * dot(directions, normals) * normals


def refracted(directions, normals, ratio):
    """Snell's law; `ratio` of the indices before and behind, normals on the side of the ray."""
    cosine = -dot(directions, normals)
    return ratio * directions + (ratio * cosine - np.sqrt(1 - ratio**2 * (1 - cosine**2))) * normals


def fresnel(cosine, ior):
    """Of unpolarised light; from the formulas of both polarisations by Snell's angles."""
    incident = np.arccos(np.clip(cosine, -1, 1))
    within = np.arcsin(np.clip(np.sin(incident) / ior, -1, 1))
    across = (np.cos(incident) - ior * np.cos(within)) / (np.cos(incident) + ior * np.cos(within))
    along = (np.cos(within) - ior * np.cos(incident)) / (np.cos(within) + ior * np.cos(incident))
    return (across**2 + along**2) / 2


# A world whose radiance is half of 1 + d for the direction d; the image has the values of the centres of its pixels.
def _smooth_world():
    height = (np.arange(256) + 0.5) / 256 * np.pi - np.pi / 2
    azimuth = 2 * np.pi * (0.5 - (np.arange(512) + 0.5) / 512)
    height, azimuth = np.meshgrid(height, azimuth, indexing="ij")
    directions = np.stack([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)], axis=-1)
    return WorldImage(np.ascontiguousarray(0.5 + 0.5 * directions, np.float32))


SMOOTH = Lighting((), (0.5, 0.5, 0.5), _smooth_world())


def radiance(directions):
    return 0.5 + 0.5 * directions


def quad(corners, material, name="quad"):
    """A rectangle of two triangles with one material."""
    vertices = np.array(corners, np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    normal = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    normals = np.broadcast_to(normal / np.linalg.norm(normal), (2, 3, 3)).astype(np.float32)
    none = np.zeros(2, np.int32)
    return Meshes(vertices, triangles, np.ascontiguousarray(normals), none, none, (MeshObject(name),), (material,))


BODIES = {
    "matt": DULL,
    "plastic": Material((1.0, 1.0, 1.0), roughness=0.3),
    "mirror": MIRROR,
    "rough metal": replace(MIRROR, roughness=0.7),
    "glass": GLASS,
    "frosted glass": replace(GLASS, roughness=0.5),
    "half glass": replace(GLASS, transmission=0.5, metallic=0.25, roughness=0.2),
    "ior 1": replace(GLASS, ior=1.0),
    "bubble": replace(GLASS, ior=0.7),
}


@pytest.mark.parametrize("tracing", [Tracing(), Tracing(reflections=0, refractions=0), Tracing(20, 20, samples=2)], ids=str)
@pytest.mark.parametrize("body", BODIES)
def test_a_white_body_in_a_white_world_is_white(body, tracing):
    image, hit = render(PAIR, BODIES[body], WHITE, tracing)
    assert hit.any()
    np.testing.assert_allclose(image[hit], 1.0, atol=2e-5)


def test_a_mirror_shows_the_world():
    image, hit = render(BALL, MIRROR, SMOOTH)
    _, normals = sphere_hits(CAMERA)
    expected = radiance(mirrored(rays(CAMERA)[1], normals))
    np.testing.assert_allclose(image[hit][:, :3], expected[hit], atol=2e-3)


def test_the_worlds_image_is_turned():
    # x of the image is y of the world.
    turned = replace(SMOOTH, image=WorldImage(SMOOTH.image.pixels, ((0, 1, 0), (-1, 0, 0), (0, 0, 1))))
    image, hit = render(BALL, MIRROR, turned)
    _, normals = sphere_hits(CAMERA)
    x, y, z = np.moveaxis(mirrored(rays(CAMERA)[1], normals), -1, 0)
    np.testing.assert_allclose(image[hit][:, :3], radiance(np.stack([y, -x, z], axis=-1))[hit], atol=2e-3)


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.9])
def test_glass_bends_and_splits_light_exactly(ior):
    image, hit = render(BALL, replace(GLASS, ior=ior), SMOOTH, Tracing(reflections=0))
    points, normals = sphere_hits(CAMERA)
    directions = rays(CAMERA)[1]
    outside = fresnel(-dot(directions, normals), ior)
    within = refracted(directions, normals, 1 / ior)
    leaves = points - 2 * dot(points, within) * within
    inward = -leaves / RADIUS
    inside = fresnel(-dot(within, inward), 1 / ior)
    expected = outside * radiance(mirrored(directions, normals)) + (1 - outside) * (
        inside * radiance(mirrored(within, inward)) + (1 - inside) * radiance(refracted(within, inward, ior))
    )
    np.testing.assert_allclose(image[hit][:, :3], expected[hit], atol=3e-3)


def test_a_body_absorbs_by_the_length_of_the_way():
    absorption = (0.3, 1.0, 4.0)
    image, hit = render(BALL, replace(GLASS, ior=1.0, absorption=absorption), WHITE)
    _, normals = sphere_hits(CAMERA)
    chord = -2 * RADIUS * dot(rays(CAMERA)[1], normals)
    np.testing.assert_allclose(image[hit][:, :3], np.exp(-chord * absorption)[hit], rtol=2e-4)


def test_from_within_steep_light_is_reflected_totally():
    camera = meniscus.Camera.perspective((0.85 * RADIUS, 0.0, 0.0), (0.85 * RADIUS, 1.0, 0.0), fov_y=1.2, width=40, height=30)
    camera = replace(camera, clip_start=1e-3)
    eye, directions = rays(camera)
    middle = -(directions @ eye)
    points = eye + (middle + np.sqrt(RADIUS**2 - (eye @ eye - middle**2)))[..., None] * directions
    inward = -points / RADIUS
    cosine = -dot(directions, inward)
    is_total = (1 - cosine**2) * 1.5**2 > 1.0001
    assert 0.2 < is_total.mean() < 0.95
    image, _ = render(BALL, GLASS, SMOOTH, Tracing(reflections=0), camera)
    share = np.where(is_total, 1.0, fresnel(cosine, 1 / 1.5))
    with np.errstate(invalid="ignore"):
        passing = np.where(is_total, 0.0, radiance(refracted(directions, inward, 1.5)))
    expected = share * radiance(mirrored(directions, inward)) + (1 - share) * passing
    np.testing.assert_allclose(image[..., :3], expected, atol=4e-3)
    np.testing.assert_allclose(image[..., 3], 1.0, atol=1e-6)


# A ball so large that it is nearly a plane through the origin, and so heavy that its influence ends where its surface is; and
# a small one above it.
CENTER, HEIGHT = 500.0, 1.2
GROUND = meniscus.Balls([[0.0, 0.0, -CENTER], [0.0, 0.0, HEIGHT]], [CENTER, 0.6], [1e8, 1.0])
LARGE = float(FIELD.kernel_radii(np.array([CENTER]), np.array([1e8]))[0])
ABOVE = meniscus.Camera.orthographic((0.0, 0.0, 0.3), (0.0, 0.0, 0.0), up=(0, 1, 0), scale=6.0, width=60, height=60)


def ground_points(camera):
    """(height, width, 3): points of the ground below an orthographic camera that looks straight down."""
    across = ((np.arange(camera.width) + 0.5) / camera.width - 0.5) * 6.0
    x, y = np.meshgrid(across, across)
    return np.stack([x, y, np.sqrt(LARGE**2 - x**2 - y**2) - CENTER], axis=-1)


def test_the_shadow_of_a_sphere_has_its_edge():
    toward = np.array([0.5, 0.1, 0.8]) / np.linalg.norm([0.5, 0.1, 0.8])
    sun = Light("SUN", (math.pi,) * 3, direction=tuple(-toward))
    image, hit = render(GROUND, DULL, Lighting((sun,)), camera=ABOVE)
    assert hit.all()
    points = ground_points(ABOVE)
    to_ball = np.array([0.0, 0.0, HEIGHT]) - points
    distance = np.linalg.norm(np.cross(to_ball, toward), axis=-1)
    is_clear_cut = np.abs(distance - 0.6 * RADIUS) > 0.003
    lit = (points - [0, 0, -CENTER]) @ toward / LARGE
    expected = np.where(distance < 0.6 * RADIUS, 0.0, lit)
    assert 0.01 < (expected == 0).mean() < 0.2
    np.testing.assert_allclose(image[..., 0][is_clear_cut], expected[is_clear_cut], atol=2e-3)
    for plain in (replace(sun, casts_shadow=False), sun):
        tracing = Tracing(shadows=plain is not sun)
        image, _ = render(GROUND, DULL, Lighting((plain,)), tracing, ABOVE)
        np.testing.assert_allclose(image[..., 0], lit, atol=2e-3)


def test_a_sun_need_not_have_a_unit_vector():
    """A direction that is hardly too short must not let a body hide itself."""
    images = []
    for length in (1.0, 0.9975, 3.0):
        sun = Light("SUN", (1.0, 1.0, 1.0), direction=(0.6 * length, 0.0, -0.8 * length))
        images.append(render(BALL, DULL, Lighting((sun,)), Tracing())[0])
    assert images[0][..., 0].max() > 0.2
    np.testing.assert_allclose(images[1], images[0], atol=1e-6)
    np.testing.assert_allclose(images[2], images[0], atol=1e-6)
    with pytest.raises(InputError, match="The direction of a light must be a vector with a length"):
        Light("SUN", (1.0, 1.0, 1.0), direction=(0.0, 0.0, 0.0))


def test_occlusion_is_what_a_sphere_hides():
    image, _ = render(GROUND, DULL, WHITE, Tracing(occlusion_rays=1024), ABOVE)
    points = ground_points(ABOVE)
    to_ball = np.array([0.0, 0.0, HEIGHT]) - points
    distance = np.linalg.norm(to_ball, axis=-1)
    cosine = (to_ball * (points - [0, 0, -CENTER])).sum(axis=-1) / distance / LARGE
    sine = 0.6 * RADIUS / distance
    is_whole = np.arccos(cosine) + np.arcsin(sine) < np.pi / 2
    # The form factor of a sphere that lies above the horizon.
    np.testing.assert_allclose(image[..., 0][is_whole], (1 - cosine * sine**2)[is_whole], atol=0.01)
    near, _ = render(GROUND, DULL, WHITE, Tracing(occlusion_rays=16, occlusion_distance=0.5), ABOVE)
    np.testing.assert_allclose(near[..., 0], 1.0, atol=1e-6)


def test_what_sees_all_of_a_world_has_no_noise_of_occlusion():
    plain, hit = render(BALL, DULL, SMOOTH)
    occluded, _ = render(BALL, DULL, SMOOTH, Tracing(occlusion_rays=4))
    np.testing.assert_allclose(occluded[hit], plain[hit], atol=1e-6)
    _, normals = sphere_hits(CAMERA)
    np.testing.assert_allclose(plain[hit][:, :3], (0.5 + normals / 3)[hit], atol=2e-3)


def test_lights_of_a_size_light_as_their_whole_does():
    below = meniscus.Camera.orthographic((0.0, 0.0, 0.2), (0.0, 0.0, 0.0), up=(0, 1, 0), scale=1e-3, width=2, height=2)
    ground = meniscus.Balls([[0.0, 0.0, -LARGE]], CENTER, 1e8)
    distance, size = 2.0, 1.5
    at = {"position": (0.0, 0.0, distance), "power": (10.0, 10.0, 10.0)}
    disc = Light("AREA", **at, size=(2 * size, 2 * size), is_round=True)
    square = Light("AREA", **at, size=(2 * size, 2 * size), right=(0.6, 0.8, 0.0))
    sphere = Light("POINT", **at, radius=size)
    sun = Light("SUN", (2.0, 2.0, 2.0), radius=0.6)
    # Form factors of a disc and of a sphere straight above; the square's is four times that of a corner.
    x = size / distance
    corner = 2 * x / math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x)) / (2 * math.pi)
    cases = [
        (disc, 10 / (math.pi * size**2) / (1 + (distance / size) ** 2) / math.pi),
        (square, 10 / (math.pi * 4 * size**2) * 4 * corner),
        (sphere, 10 / (4 * math.pi**2 * distance**2)),
        (sun, 2.0 / math.pi),
    ]
    cases[0] = (disc, 10 / (math.pi * math.pi * size**2) * size**2 / (size**2 + distance**2))
    for light, expected in cases:
        image, _ = render(ground, DULL, Lighting((light,)), Tracing(samples=1024), below)
        assert image[..., 0] == pytest.approx(expected, rel=0.01), light


@pytest.mark.parametrize("reflections", [0, 1])
def test_a_mirror_shows_lights_of_a_size(reflections):
    sun = Light("SUN", (0.3, 0.2, 0.1), direction=(0.0, 1.0, 0.0), radius=0.4)
    lamp = Light("AREA", (5.0, 5.0, 5.0), (0.0, -3.0, 1.5), (0.0, 1.0, 0.0), size=(2.0, 0.8))
    _, normals = sphere_hits(CAMERA)
    points, _ = sphere_hits(CAMERA)
    image, hit = render(BALL, MIRROR, Lighting((sun, lamp)), Tracing(reflections=reflections))
    directions = mirrored(rays(CAMERA)[1], normals)[hit]
    angle = np.arccos(np.clip(-directions[:, 1], -1, 1))
    shows_sun = (angle < 0.4)[:, None] * np.array([0.3, 0.2, 0.1]) / (math.pi * math.sin(0.4) ** 2)
    with np.errstate(invalid="ignore"):
        t = (-3.0 - points[hit][:, 1]) / directions[:, 1]
    x, _, z = (points[hit] + t[:, None] * directions).T
    shows_lamp = (t > 0) & (np.abs(x) < 1.0) & (np.abs(z - 1.5) < 0.4)
    expected = shows_sun + shows_lamp[:, None] * 5.0 / (math.pi * 1.6)
    edge = np.abs(angle - 0.4) < 0.01
    edge |= (t > 0) & ((np.abs(np.abs(x) - 1.0) < 0.02) | (np.abs(np.abs(z - 1.5) - 0.4) < 0.02))
    assert shows_lamp.any()
    assert (shows_sun > 0).any()
    np.testing.assert_allclose(image[hit][~edge][:, :3], expected[~edge], atol=1e-3)


@pytest.mark.parametrize("reflections", range(4))
def test_mirrors_that_face_each_other_end_at_the_bound(reflections):
    dim = Material((0.5, 0.25, 1.0), metallic=1.0, roughness=0.0)
    low, high = ([(-9, -9, z), (9, -9, z), (9, 9, z), (-9, 9, z)] for z in (0.0, 5.0))
    floor, ceiling = quad(low, dim), quad(high[::-1], dim)
    both = Meshes(
        np.concatenate([floor.vertices, ceiling.vertices]),
        np.concatenate([floor.triangles, ceiling.triangles + 4]),
        np.concatenate([floor.normals, ceiling.normals]),
        *np.zeros((2, 4), np.int32),
        floor.objects,
        floor.materials,
    )
    camera = meniscus.Camera.perspective((0, 0, 2.5), (0, 0, 0), up=(0, 1, 0), fov_y=0.01, width=4, height=4)
    image, _ = render(NO_BALLS, DULL, WHITE, Tracing(reflections=reflections), camera, both)
    expected = np.array(dim.color) ** (reflections + 1)
    np.testing.assert_allclose(image[..., :3], np.broadcast_to(expected, (4, 4, 3)), rtol=1e-3)


def test_meshes_are_seen_in_mirrors_and_through_glass_and_hide_lights():
    glowing = Material((0.0, 0.0, 0.0), ior=1.0, emission=(1.0, 2.0, 3.0))
    behind = quad([(-9, 3, -9), (9, 3, -9), (9, 3, 9), (-9, 3, 9)], glowing)
    image, _ = render(BALL, replace(GLASS, ior=1.0), Lighting(), camera=CAMERA, meshes=behind)
    hit = np.isfinite(sphere_hits(CAMERA)[0][..., 0])
    np.testing.assert_allclose(image[hit], np.broadcast_to([1.0, 2.0, 3.0, 1.0], image[hit].shape), atol=1e-5)
    before = quad([(-9, -5, -9), (9, -5, -9), (9, -5, 9), (-9, -5, 9)], glowing)
    image, _ = render(BALL, MIRROR, Lighting(), meshes=before)
    points, normals = sphere_hits(CAMERA)
    directions = mirrored(rays(CAMERA)[1], normals)
    with np.errstate(invalid="ignore"):
        place = points + ((-5 - points[..., 1]) / directions[..., 1])[..., None] * directions
    is_met = (directions[..., 1] < 0) & (np.abs(place[..., 0]) < 9) & (np.abs(place[..., 2]) < 9)
    assert 0.1 < is_met[hit].mean() < 0.9
    np.testing.assert_allclose(image[hit][:, 2], 3.0 * is_met[hit], atol=1e-5)
    roof = quad([(-9, -9, 4), (9, -9, 4), (9, 9, 4), (-9, 9, 4)], DULL)
    sun = Lighting((Light("SUN", (1.0, 1.0, 1.0)),))
    assert render(BALL, DULL, sun)[0][hit].max() > 0.2
    assert render(BALL, DULL, sun, meshes=roof)[0][hit][:, :3].max() == 0


def test_fluid_shadows_meshes_and_clear_fluid_lets_light_pass():
    floor = quad([(-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)], DULL)
    camera = meniscus.Camera.orthographic((0, 0, -0.8), (0, 0, -1), up=(0, 1, 0), scale=4.0, width=40, height=40)
    sun = Lighting((Light("SUN", (math.pi,) * 3),))
    image, _ = render(BALL, DULL, sun, camera=camera, meshes=floor)
    across = ((np.arange(40) + 0.5) / 40 - 0.5) * 4
    x, y = np.meshgrid(across, across)
    distance = np.hypot(x, y)
    clear_cut = np.abs(distance - RADIUS) > 0.01
    np.testing.assert_allclose(image[..., 0][clear_cut], (distance > RADIUS)[clear_cut], atol=1e-4)
    tinted = replace(GLASS, color=(0.5, 0.5, 0.5), ior=1.0, absorption=(1.0, 1.0, 1.0))
    image, _ = render(BALL, tinted, sun, camera=camera, meshes=floor)
    chord = 2 * np.sqrt(np.maximum(RADIUS**2 - distance**2, 0))
    expected = np.where(distance < RADIUS, 0.5 * np.exp(-chord), 1.0)
    np.testing.assert_allclose(image[..., 0][clear_cut], expected[clear_cut], atol=1e-3)
    assert render(BALL, tinted, sun, Tracing(refractions=1), camera, floor)[0][20, 20, 0] == 0


def test_rough_surfaces_have_no_sparks_of_lights_behind_glass():
    floor = quad([(-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)], Material((0.8, 0.8, 0.8), metallic=1.0, roughness=0.6))
    camera = meniscus.Camera.orthographic((0, 0, -0.8), (0, 0, -1), up=(0, 1, 0), scale=4.0, width=60, height=60)
    sun = Lighting((Light("SUN", (1.0, 1.0, 1.0), direction=(0.6, 0.0, -0.8), radius=0.02),), (0.5, 0.5, 0.5))
    image, _ = render(BALL, GLASS, sun, Tracing(samples=16), camera, floor)
    # The sun's disc is 800 times as bright.
    assert image.max() < 4


def test_a_clear_film_is_seen_through_clear_bodies():
    tinted = replace(GLASS, color=(0.81, 0.36, 0.09), ior=1.0)
    image, hit = render(BALL, tinted, WHITE, background=CLEAR)
    np.testing.assert_allclose(image[hit], np.broadcast_to([0, 0, 0, 1 - 0.42], image[hit].shape), atol=1e-4)
    image, hit = render(BALL, GLASS, WHITE, background=CLEAR)
    share = fresnel(-dot(rays(CAMERA)[1], sphere_hits(CAMERA)[1]), 1.5)[hit][:, 0]
    # At least what is mirrored outside is the world's; all that is seen and what is seen through it make one.
    assert (image[hit][:, 3] >= share - 1e-5).all()
    np.testing.assert_allclose(image[hit][:, 0], image[hit][:, 3], atol=1e-5)


NOISY = replace(GLASS, roughness=0.3, transmission=0.5)
NOISY_LIGHT = Lighting((Light("POINT", (50.0,) * 3, (1.0, -2.0, 3.0), radius=0.5),), (0.5, 0.6, 0.7), SMOOTH.image)


def test_threads_do_not_change_the_picture():
    tracing = Tracing(occlusion_rays=3, samples=2)
    pictures = [render(PAIR, NOISY, NOISY_LIGHT, tracing, threads=threads)[0] for threads in (1, 2, 5)]
    assert all((picture == pictures[0]).all() for picture in pictures)


def test_images_of_a_view_are_parts_of_one():
    whole, _ = render(PAIR, NOISY, NOISY_LIGHT, Tracing(occlusion_rays=3, samples=4))
    halves = [render(PAIR, NOISY, NOISY_LIGHT, Tracing(occlusion_rays=3, samples=2), sample=k)[0] for k in (0, 1)]
    assert (halves[0] != halves[1]).any()
    np.testing.assert_allclose(np.mean(halves, axis=0), whole, atol=1e-5)


def test_more_samples_have_less_noise():
    lamp = Lighting((Light("AREA", (30.0,) * 3, (1.0, 0.0, 2.5), size=(1.0, 1.0)),))
    reference = render(GROUND, DULL, lamp, Tracing(samples=256), ABOVE)[0]
    once, often = (np.abs(render(GROUND, DULL, lamp, Tracing(samples=count), ABOVE)[0] - reference).mean() for count in (1, 16))
    # Numbers at random would give a quarter.
    assert often < 0.15 * once


def test_balls_are_seen_in_their_colors():
    colors = np.array([[0.9, 0.1, 0.1], [0.1, 0.1, 0.9]])
    balls = meniscus.Balls([[0, 0, 0], [0, 0, 3.0]], 1.0, colors=colors)
    matt = replace(DULL, color=(0.0, 1.0, 0.0))
    glass = replace(MIRROR, color=(0.5, 0.5, 0.5))
    camera = replace(CAMERA, width=8, height=8)
    image, hit = render(balls, matt, WHITE, camera=camera)
    np.testing.assert_allclose(image[hit][:, :3], np.broadcast_to(colors[0], image[hit][:, :3].shape), atol=1e-5)
    # A mirror above a ball shows it.
    down = meniscus.Camera.perspective((0.0, 0.0, 1.5), (0.0, 0.0, 3.0), up=(0, 1, 0), fov_y=0.02, width=4, height=4)
    two = meniscus.Balls(balls.positions, 1.0, colors=colors, sources=[0, 1])
    look = meniscus.Look(
        "material", sources=(FluidSource(material=matt), FluidSource(material=glass)), lighting=WHITE, tracing=Tracing()
    )
    image = meniscus.render(two, down, FIELD, passes=("combined",), look=look, backend="cpu")["combined"]
    np.testing.assert_allclose(image[..., :3], np.broadcast_to(colors[0] * colors[1], (4, 4, 3)), atol=1e-3)


def test_bad_and_borderline_input():
    image, hit = render(NO_BALLS, GLASS, WHITE)
    assert not hit.any()
    assert (image == [0, 0, 0, 1]).all()
    image, hit = render(meniscus.Balls(np.zeros((50, 3)), 1.0), GLASS, WHITE)
    assert hit.any()
    np.testing.assert_allclose(image[hit], 1.0, atol=1e-4)
    image, hit = render(PAIR, DULL, Lighting())
    assert hit.any()
    assert (image[hit] == [0, 0, 0, 1]).all()
    for ior in (0.0, -1.0, math.nan):
        with pytest.raises(InputError, match="index of refraction"):
            render(BALL, replace(GLASS, ior=ior), WHITE)


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ({"reflections": -1}, "reflections must be from 0 to 64, not -1"),
        ({"refractions": 65}, "refractions must be from 0 to 64, not 65"),
        ({"occlusion_rays": 5000}, "occlusion rays must be from 0 to 4096"),
        ({"samples": 0}, "light samples must be from 1 to 65536, not 0"),
        ({"occlusion_distance": 0.0}, "distance of ambient occlusion must be greater than 0"),
        ({"occlusion_distance": math.nan}, "distance of ambient occlusion must be greater than 0"),
    ],
)
def test_unusable_settings_are_told(setting, sentence):
    with pytest.raises(InputError, match=sentence):
        Tracing(**setting)


def test_unusable_images_of_the_world_are_told():
    with pytest.raises(InputError, match="float32 of the shape"):
        WorldImage(np.zeros((4, 8), np.float32))
    with pytest.raises(InputError, match="not finite"):
        WorldImage(np.full((4, 8, 3), np.inf, np.float32))
    with pytest.raises(InputError, match="rotation"):
        WorldImage(np.zeros((4, 8, 3), np.float32), ((1, 0, 0), (0, 1, 0), (0, 0, 2)))


def test_the_tree_of_balls_is_kept_between_samples():
    from meniscus.addon.render.tracing import _Kept

    kept, made = _Kept(), []

    def make():
        made.append(1)
        return len(made)

    balls = meniscus.Balls(np.zeros((1, 3)), 1.0)
    assert [kept.made(balls, FIELD, make), kept.made(balls, FIELD, make), kept.made(balls, "other", make)] == [1, 1, 2]
    del balls
    assert not kept._made
