"""Traced light on the graphics processor shows what the native core does, from the surface of any method."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scenes import SCENES, Scene

import meniscus
from meniscus.addon.fluid.lighting import FluidSource, Light, Lighting, Material, WorldImage
from meniscus.addon.fluid.meshes import Meshes, MeshObject
from meniscus.addon.fluid.tracing import Tracing
from meniscus.addon.render import native, registry, renderer
from meniscus.addon.render.backdrop import backdrop
from meniscus.addon.render.fitted_bvh import FittedBvh
from meniscus.addon.render.method import Request
from meniscus.addon.render.registry import create_method, method_infos
from meniscus.addon.render.tracing import SeenSurface, TracedScene, trace_image
from meniscus.gpu_shaders.tracing import images, stage
from meniscus.gpu_shaders.tracing.stage import TracedFluid, TracedLight

MEMORIES = pytest.mark.parametrize("with_storage", [False, True], ids=["textures", "storage"])
GPU_METHODS = [info.name for info in method_infos("metaballs") if info.backend == "gpu"]

SUN = Light("SUN", (2.0, 1.9, 1.8), direction=(-0.4, 0.6, -0.6928203), radius=0.05)
LAMPS = (
    Light("POINT", (60.0, 50.0, 80.0), position=(2.0, -3.0, 2.0), radius=0.3),
    Light("SPOT", (200.0, 100.0, 80.0), position=(-2.0, -3.0, 2.0), direction=(0.4851, 0.7276, -0.4851), cone=(0.9, 0.3)),
    Light("AREA", (60.0, 70.0, 60.0), (1.5, -3.0, 2.5), (-0.4, 0.7, -0.5916), size=(1.0, 0.6), right=(0.8683, 0.4961, 0.0)),
)
SKY = Lighting((SUN,), world=(0.3, 0.4, 0.6))
ROOM = Lighting((SUN, *LAMPS), world=(0.1, 0.1, 0.2))
MATT = Material(color=(0.8, 0.5, 0.3), roughness=0.4)
METAL = Material(color=(0.9, 0.8, 0.5), roughness=0.0, metallic=1.0)
GLASS = Material(color=(0.9, 0.95, 1.0), roughness=0.0, transmission=1.0, ior=1.33, absorption=(1.5, 0.4, 0.2))


@dataclass(frozen=True)
class Traced:
    """What is traced, and the samples that it takes."""

    scene: Scene
    materials: tuple[Material, ...]
    lighting: Lighting
    tracing: Tracing = field(default_factory=Tracing)
    is_film_clear: bool = False

    def images(self, opengl, method="fitted_bvh", with_storage=False, projection="perspective", light=None):
        """(height, width, 4) by the graphics processor and by the native core, and where there is a surface."""
        balls, camera = self.scene.balls, self.scene.camera(projection)
        info, runner = create_method(method)
        settings = {setting.name: setting.default for setting in info.settings}
        request = Request(balls, camera, self.scene.field, frozenset({"color"}), 0, lambda _: None, settings=settings)
        surface = runner.find_surface_on_device(request)
        light = light or TracedLight(opengl, with_storage)
        found = opengl.run(lambda: self._on_device(light, surface, camera))
        passes = surface.read_back()
        return found, self._on_cpu(passes, camera), passes["depth"] < 1e9

    def _on_device(self, light, surface, camera):
        balls, image = self.scene.balls, self.lighting.image
        fluid = TracedFluid(FittedBvh(balls, self.scene.field).arrays(), balls, self.scene.field, self.materials)
        irradiance = None if image is None else native.load().WorldImage(image.pixels).irradiance()
        texture = light.trace(
            surface, camera, fluid, self.lighting, self.tracing, irradiance, 3 * self.tracing.samples, self.is_film_clear
        )
        return np.frombuffer(texture.read(), np.float32).reshape(camera.height, camera.width, 4)

    def _on_cpu(self, passes, camera):
        balls = self.scene.balls
        exact = meniscus.render(balls, camera, self.scene.field, method="tile_caster", passes=("depth", "normal", "ball_id"))
        hit = passes["depth"] < 1e9
        ball = np.where(hit, np.maximum(exact["ball_id"], 0), -1).astype(np.int32)
        source = np.zeros_like(ball) if balls.sources is None else balls.sources[np.maximum(ball, 0)]
        colors = np.array([material.color for material in self.materials], np.float32)[source]
        seen = SeenSurface(
            passes["depth"].copy(), passes["normal"].copy(), passes.get("color", colors), np.where(hit, source, -1), ball
        )
        rgba = np.zeros((*hit.shape, 4), np.float32)
        traced = TracedScene(balls, self.scene.field, self.materials, self.lighting)
        trace_image(rgba, seen, camera, traced, self.tracing, image=3, is_film_clear=self.is_film_clear)
        return rgba


def assert_same_picture(found, wanted, hit, share=0.0):
    """But for a share of the pixels, in which a path took another turn."""
    assert hit.mean() > 0.05
    assert np.ptp(wanted[hit][:, :3]) > 0.2, "the picture should show something"
    assert np.all(np.isfinite(found))
    assert not found[~hit].any()
    assert np.mean(np.abs(found - wanted)[hit].max(axis=1) > 2e-3) <= share
    np.testing.assert_allclose(found[hit].mean(axis=0), wanted[hit].mean(axis=0), rtol=2e-3, atol=1e-5)


@MEMORIES
@pytest.mark.parametrize("material", [MATT, METAL], ids=["matt", "metal"])
def test_lights_and_occlusion(opengl, material, with_storage):
    traced = Traced(SCENES["random_5000"](), (material,), ROOM, Tracing(occlusion_rays=8, occlusion_distance=0.5))
    assert_same_picture(*traced.images(opengl, with_storage=with_storage), share=2e-3)


def test_shadows_take_light_away(opengl):
    traced = Traced(SCENES["random_5000"](), (MATT,), ROOM)
    found, _, hit = traced.images(opengl)
    without, wanted, _ = replace(traced, tracing=Tracing(shadows=False)).images(opengl)
    assert_same_picture(without, wanted, hit, share=2e-3)
    assert without[hit][:, :3].mean() > 1.05 * found[hit][:, :3].mean()


@MEMORIES
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_glass(opengl, projection, with_storage):
    traced = Traced(SCENES["ten_balls"](), (GLASS,), ROOM)
    assert_same_picture(*traced.images(opengl, with_storage=with_storage, projection=projection), share=1e-3)


@MEMORIES
def test_an_image_of_the_world_and_rough_glass(opengl, with_storage):
    pixels = np.random.default_rng(3).random((8, 16, 3), np.float32) * [[[2.0, 1.0, 0.5]]]
    turn = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    world = WorldImage(pixels.astype(np.float32), turn)
    rough = replace(GLASS, roughness=0.3, transmission=0.6)
    lighting = Lighting((LAMPS[0],), world.mean, world)
    traced = Traced(SCENES["ten_balls"](), (rough,), lighting, Tracing(samples=2, occlusion_rays=4))
    assert_same_picture(*traced.images(opengl, with_storage=with_storage), share=2e-3)


@MEMORIES
def test_another_image_of_the_world_is_another_light(opengl, with_storage):
    """What is kept of one must not be shown for the next."""
    light = TracedLight(opengl, with_storage)
    for channel in range(3):
        world = WorldImage(np.ascontiguousarray(np.broadcast_to(np.eye(3, dtype=np.float32)[channel], (4, 8, 3))))
        traced = Traced(SCENES["ten_balls"](), (METAL,), Lighting((), world.mean, world))
        found, wanted, hit = traced.images(opengl, with_storage=with_storage, light=light)
        assert_same_picture(found, wanted, hit, share=0)
        assert found[hit][:, channel].min() > 0.1


@MEMORIES
def test_sources_with_materials_of_their_own(opengl, with_storage):
    scene = SCENES["ten_balls"]()
    balls = meniscus.Balls(scene.balls.positions, scene.balls.radii, sources=np.arange(10) % 2)
    traced = Traced(replace(scene, balls=balls), (METAL, MATT), SKY)
    found, wanted, hit = traced.images(opengl, with_storage=with_storage)
    assert_same_picture(found, wanted, hit, share=5e-3)


@pytest.mark.parametrize("method", GPU_METHODS)
def test_the_surface_of_any_method_will_do(opengl, method):
    scene = SCENES["ten_balls"]()
    colors = np.random.default_rng(5).random((10, 3))
    balls = meniscus.Balls(scene.balls.positions, scene.balls.radii, colors=colors)
    traced = Traced(replace(scene, balls=balls), (MATT,), SKY)
    assert_same_picture(*traced.images(opengl, method), share=2e-3)


@pytest.mark.parametrize("name", ["far_from_origin", "radii_over_six_orders", "negative_weights"])
def test_hard_scenes(opengl, name):
    traced = Traced(SCENES[name](), (replace(GLASS, absorption=(0.2, 0.1, 0.1)),), SKY, Tracing(reflections=2, refractions=4))
    assert_same_picture(*traced.images(opengl), share=5e-3)


def test_a_clear_film_is_transparent_where_glass_is(opengl):
    scene = Scene(meniscus.Balls([[0, 0, 0]], 1.2))
    thin = Material(color=(1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=1.0)
    found, wanted, hit = Traced(scene, (thin,), SKY, is_film_clear=True).images(opengl)
    np.testing.assert_allclose(found[hit], wanted[hit], atol=1e-4)
    assert np.median(found[hit][:, 3]) < 1e-3


def test_mirrors_that_face_each_other_end_at_the_depth(opengl):
    scene = Scene(meniscus.Balls([[-0.65, 0, 0], [0.65, 0, 0]], 1.0))
    endless = Traced(scene, (replace(METAL, color=(1.0, 1.0, 1.0)),), SKY, Tracing(reflections=64))
    assert_same_picture(*endless.images(opengl), share=2e-2)


def combined(scene, camera, look, method="fitted_bvh"):
    return meniscus.render(scene.balls, camera, scene.field, method=method, passes=("combined",), look=look, sample=2)[
        "combined"
    ]


@pytest.fixture
def hardware(monkeypatch, opengl):
    """Has OpenGL taken for hardware, so that light is traced there; gives how often that was."""
    traced = []
    trace = images.ImageTracer._trace
    monkeypatch.setattr(renderer, "runs_in_software_opengl", lambda _: False)
    monkeypatch.setattr(images.ImageTracer, "_trace", lambda *arguments: (traced.append(1), trace(*arguments))[1])
    return traced


@pytest.mark.parametrize("contrast", [0.0, 2.0])
def test_combined_is_traced_where_the_method_runs(hardware, monkeypatch, contrast):
    """In parts, each of a few samples."""
    monkeypatch.setattr(images, "_RAYS_AT_ONCE", 3 * 96 * 72)
    world = WorldImage(np.random.default_rng(3).random((8, 16, 3), np.float32))
    look = meniscus.Look(
        style="material",
        color=(0.8, 0.5, 0.3),
        lighting=Lighting((SUN,), world.mean, world),
        tracing=Tracing(samples=7),
        depth_contrast=contrast,
    )
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    found, wanted = combined(scene, camera, look), combined(scene, camera, look, "tile_caster")
    assert len(hardware) == 3
    assert_same_picture(found, wanted, wanted[..., 3] > 0, share=5e-3)


def test_no_balls_have_no_light(hardware):
    scene = Scene(meniscus.Balls(np.zeros((0, 3)), 1.0))
    look = meniscus.Look(style="material", lighting=SKY, tracing=Tracing())
    assert not combined(scene, scene.camera("perspective"), look).any()
    assert not hardware


def test_one_ball_without_any_light_is_black(hardware):
    scene = SCENES["one_ball"]()
    picture = combined(
        scene, scene.camera("perspective"), meniscus.Look(style="material", lighting=Lighting(), tracing=Tracing())
    )
    assert picture[..., 3].any()
    assert not picture[..., :3].any()


def floor_and_roof() -> Meshes:
    """A glossy floor below the fluid, and a pane of glass before it."""
    floor = [[-3, -3, -1.2], [3, -3, -1.2], [3, 3, -1.3], [-3, 3, -1.3]]
    pane = [[-0.9, -1.7, -0.6], [0.9, -1.6, -0.6], [0.9, -1.6, 0.7], [-0.9, -1.7, 0.7]]
    backs = [[x, y + 0.1, z] for x, y, z in pane]
    vertices = np.array([*floor, *pane, *backs], np.float32)
    quads = np.array([[0, 1, 2, 3], [4, 5, 6, 7], [11, 10, 9, 8]], np.int32)
    triangles = np.ascontiguousarray(np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    sides = vertices[triangles].astype(np.float64)
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    tiles = Material(color=(0.7, 0.3, 0.2), roughness=0.3)
    return Meshes(
        vertices,
        triangles,
        np.repeat(normals[:, None], 3, axis=1).astype(np.float32),
        np.zeros(6, np.int32),
        np.array([0, 1, 1, 0, 1, 1], np.int32),
        (MeshObject("room"),),
        (tiles, replace(GLASS, roughness=0.0)),
    )


@pytest.mark.parametrize("with_storage", [False, True], ids=["textures", "storage"])
@pytest.mark.parametrize("material", [GLASS, MATT], ids=["glass", "matt"])
def test_meshes_are_seen_and_hide_light(hardware, monkeypatch, material, with_storage):
    monkeypatch.setattr(stage, "uses_storage", lambda _: with_storage)
    monkeypatch.setattr(images, "image_tracer", lambda: images.ImageTracer(registry.gpu().shared_context()))
    scene = SCENES["ten_balls"]()
    camera, room = scene.camera("perspective"), floor_and_roof()
    source = FluidSource("fluid", material=material)
    look = meniscus.Look(style="material", lighting=ROOM, tracing=Tracing(occlusion_rays=4), sources=(source,))
    look = replace(look, color=material.color)
    pictures = [
        meniscus.render(
            scene.balls,
            camera,
            scene.field,
            method,
            passes=("combined",),
            look=look,
            backdrop=backdrop(room, camera, ROOM, (0.0, 0.0, 0.0, 1.0)),
        )
        for method in ("fitted_bvh", "tile_caster")
    ]
    assert len(hardware) == 1
    found, wanted = (picture["combined"] for picture in pictures)
    assert wanted[..., 3].mean() > 0.5
    assert np.ptp(wanted[..., :3]) > 0.2
    assert np.mean(np.abs(found - wanted).max(axis=2) > 4e-3) <= 5e-3
    np.testing.assert_allclose(found.mean(axis=(0, 1)), wanted.mean(axis=(0, 1)), rtol=2e-3)
