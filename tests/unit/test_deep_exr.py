"""Deep images: tidy, as OpenEXR reads them, and flattened the image that they were made from."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

import meniscus
from meniscus.addon.fluid.camera import Region
from meniscus.addon.fluid.lighting import FluidSource, Lighting, Material
from meniscus.addon.output.exr_content import ExrOptions, deep_content
from meniscus.addon.output.exr_process import ExrProcess
from meniscus.addon.render.surroundings import Backdrop

FIELD = meniscus.Field("quartic", 0.25)
CAMERA = meniscus.Camera.perspective((0, -5, 0), (0, 0, 0), fov_y=0.5, width=32, height=24)
GLASS = Material((0.9, 0.6, 0.3), transmission=0.8, roughness=0.3)
LOOKS = {
    "opaque": meniscus.Look("headlight"),
    "water": meniscus.Look("water", color=(0.1, 0.5, 0.8)),
    "glass": meniscus.Look("material", sources=(FluidSource(material=GLASS),), lighting=Lighting((), (0.5, 0.6, 0.7))),
}


@pytest.fixture(scope="module")
def balls():
    rng = np.random.default_rng(11)
    return meniscus.Balls(rng.uniform(-1, 1, (60, 3)), rng.uniform(0.3, 0.5, 60))


def read(path):
    """Channels as (height, width) objects, and the header; row 0 at the top."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}, dict(file.header())


def flattened(channels):
    """(height, width, 5): premultiplied colours and alpha, the nearest over the others, and the first Z; row 0 at the top."""
    shape = channels["Z"].shape
    image = np.zeros((*shape, 5))
    image[..., 4] = 1e10
    for place in np.ndindex(shape):
        if channels["Z"][place] is None:
            continue
        samples = np.stack([channels[name][place].astype(np.float64) for name in "RGBA"], axis=1)
        for sample in samples:
            image[place][:4] += (1 - image[place][3]) * sample
        image[place][4] = channels["Z"][place][0]
    return image


@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS)
def test_flattened_it_is_the_flat_image(tmp_path, balls, look):
    flat = meniscus.render(balls, CAMERA, FIELD, passes=("combined", "depth"), look=look)
    deep = meniscus.render_deep(balls, CAMERA, FIELD, look=look)
    meniscus.write_deep_exr(tmp_path / "deep.exr", deep)
    channels, header = read(tmp_path / "deep.exr")
    assert header["type"] == OpenEXR.deepscanline
    image = flattened(channels)[::-1]
    np.testing.assert_allclose(image[..., :4], flat["combined"], atol=2e-3 * max(1, flat["combined"].max()))
    np.testing.assert_allclose(image[..., 4], flat["depth"], rtol=1e-6)
    assert deep.counts.max() > 1, "some ray should meet the fluid twice"


def test_samples_are_tidy_and_know_their_normals(tmp_path, balls):
    meniscus.write_deep_exr(tmp_path / "deep.exr", meniscus.render_deep(balls, CAMERA, FIELD, look=LOOKS["water"]))
    channels, _ = read(tmp_path / "deep.exr")
    assert set(channels) == {"R", "G", "B", "A", "Z", "ZBack", "N.X", "N.Y", "N.Z"}
    dtypes = {name: next(item for item in pixels.flat if item is not None).dtype for name, pixels in channels.items()}
    assert all(dtype == (np.float16 if name in "RGBA" else np.float32) for name, dtype in dtypes.items())
    for place in np.ndindex(channels["Z"].shape):
        if channels["Z"][place] is not None:
            near, far = channels["Z"][place], channels["ZBack"][place]
            assert np.all(near <= far)
            assert np.all(far[:-1] <= near[1:])
            normals = np.stack([channels[f"N.{axis}"][place] for axis in "XYZ"], axis=1)
            np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-4)
    assert any(len(item) > 1 for item in channels["Z"].flat if item is not None)


def test_a_sample_reaches_from_front_to_back(balls):
    ball = meniscus.Balls([(0, 0, 0)], 0.5 / np.sqrt(0.5))
    camera = replace(CAMERA, width=33, height=25)
    deep = meniscus.render_deep(ball, camera, FIELD, look=LOOKS["water"])
    middle = deep.counts.reshape(-1)[: 12 * 33 + 16].sum()
    assert (deep.enter[middle], deep.leave[middle]) == pytest.approx((4.5, 5.5), abs=1e-5)
    np.testing.assert_allclose(deep.normal[middle], [0, -1, 0], atol=1e-4)


def test_what_hides_the_fluid_ends_its_samples(balls):
    wall = replace(Backdrop.empty(CAMERA), depth=np.full((24, 32), 5.0, np.float32), names=("Wall",))
    deep = meniscus.render_deep(balls, CAMERA, FIELD, look=LOOKS["water"], backdrop=wall)
    whole = meniscus.render_deep(balls, CAMERA, FIELD, look=LOOKS["water"])
    assert deep.leave.max() <= 5.0 < whole.leave.max()
    assert 0 < deep.counts.sum() < whole.counts.sum()


def test_a_region_lies_where_it_belongs(balls):
    region = Region(8, 4, 20, 16)
    deep = meniscus.render_deep(balls, replace(CAMERA, region=region), FIELD)
    whole = meniscus.render_deep(balls, CAMERA, FIELD)
    inside = np.zeros((24, 32), bool)
    inside[4:16, 8:20] = True
    np.testing.assert_array_equal(deep.counts, np.where(inside, whole.counts, 0))


@pytest.mark.parametrize("compression", ["ZIPS", "RLE", "NONE"])
def test_the_child_process_writes_the_same(tmp_path, balls, compression):
    deep = meniscus.render_deep(balls, CAMERA, FIELD)
    meniscus.write_deep_exr(tmp_path / "here.exr", deep, compression=compression, frame=5)
    with ExrProcess() as writer:
        writer.write(tmp_path / "there.exr", deep_content(deep, ExrOptions(compression=compression, frame=5))).result()
    assert (tmp_path / "there.exr").read_bytes() == (tmp_path / "here.exr").read_bytes()


def test_an_image_without_fluid_is_written_too(tmp_path):
    nothing = meniscus.render_deep(meniscus.Balls(np.empty((0, 3)), 1.0), CAMERA, FIELD)
    meniscus.write_deep_exr(tmp_path / "deep.exr", nothing)
    assert all(item is None or not len(item) for item in read(tmp_path / "deep.exr")[0]["Z"].flat)


def test_compression_that_deep_images_have_not_is_refused(tmp_path, balls):
    deep = meniscus.render_deep(balls, CAMERA, FIELD)
    with pytest.raises(meniscus.MeniscusError, match="Deep images cannot be compressed by PIZ: choose from ZIPS"):
        meniscus.write_deep_exr(tmp_path / "deep.exr", deep, compression="PIZ")
