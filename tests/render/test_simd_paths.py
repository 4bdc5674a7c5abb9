"""Every SIMD path sees the same surface, whatever the number of threads."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import meniscus_native
import numpy as np
import pytest
from judge import expected, is_undecidable, judge
from path_images import PROJECTIONS
from scenes import HEIGHT, SCENES, WIDTH

import meniscus
from meniscus.addon.fluid.image import RenderInfo
from meniscus.addon.fluid.kernels import KERNELS, PolynomialKernel

PATHS: list[str] = meniscus_native.simd_paths()
SCRIPT = Path(__file__).with_name("path_images.py")

# How far depths of two paths may lie apart. Without fused multiplications sums round otherwise: the distance by units in its
# last place, and the density by 1e-7 or so, which moves the crossing by that over the density's slope. The slope is about
# 1 / R, but at silhouettes a hundredth of it.
ULPS = 4
SHARE_OF_RADIUS = 1e-4


@pytest.fixture(scope="module")
def images(tmp_path_factory) -> dict[str, dict[str, np.ndarray]]:
    """What `path_images.py` saves, by path."""
    found = {}
    for path in PATHS:
        output = tmp_path_factory.mktemp("paths") / f"{path}.npz"
        command = [sys.executable, str(SCRIPT), str(output)]
        subprocess.run(command, env={**os.environ, "MENISCUS_SIMD": path}, check=True, timeout=300)
        with np.load(output) as saved:
            found[path] = dict(saved)
    return found


def image_of(images, path, name, projection) -> meniscus.ImageBuffers:
    camera = SCENES[name]().camera(projection)
    part = {part: images[path][f"{name} {projection} {part}"] for part in ("depth", "normal", "hit")}
    return meniscus.ImageBuffers(camera, {"depth": part["depth"], "normal": part["normal"]}, part["hit"], RenderInfo())


def test_each_process_took_the_path_that_it_was_told_to(images):
    assert {path: str(images[path]["path"]) for path in PATHS} == {path: path for path in PATHS}


@pytest.mark.slow
@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("name", SCENES)
def test_every_path_matches_the_oracle_and_the_first_path(images, name, projection):
    scene = SCENES[name]()
    camera = scene.camera(projection)
    first, *others = (image_of(images, path, name, projection) for path in PATHS)
    want = expected(scene.balls, scene.field, camera)
    # The first path is what the process itself takes, and test_methods_against_oracle.py judges that.
    for other in others:
        judge(other, scene, camera)
        both = first.hit & other.hit
        depths = np.stack([first["depth"], other["depth"]])
        apart = np.abs(np.diff(depths.astype(np.float64), axis=0)[0])
        allowed = ULPS * np.spacing(depths.max(axis=0)) + SHARE_OF_RADIUS * want.radius.reshape(HEIGHT, WIDTH)
        differs = (first.hit != other.hit) | (both & (apart > allowed))
        for pixel in np.flatnonzero(differs):
            t_image = float(first["depth"].ravel()[pixel] * want.stretch[pixel]) if first.hit.ravel()[pixel] else np.inf
            assert is_undecidable(scene.balls, scene.field, want, pixel, camera, t_image), divmod(int(pixel), WIDTH)
        assert differs.mean() <= 1e-3


def test_threads_and_repetition_change_no_bit():
    scene = SCENES["random_5000"]()
    camera = replace(scene.camera("perspective"), width=640, height=480)
    passes = ("depth", "normal", "ball_id")

    def image(threads: int) -> meniscus.ImageBuffers:
        return meniscus.render(scene.balls, camera, scene.field, method="tile_caster", passes=passes, threads=threads)

    first = image(1)
    assert first.hit.mean() > 0.2
    for threads in (1, 2, 2, 3, 8, 8):
        again = image(threads)
        for name in passes:
            assert again[name].tobytes() == first[name].tobytes(), (threads, name)


@pytest.mark.parametrize("coefficients", [(0.0, 0.5, 0.0, 0.0, 0.5), (0.0, 0.1, 0.9), (0.0, 0.05, 0.05, 0.0, 0.9)])
def test_kernels_with_a_linear_and_a_steeper_term(monkeypatch, coefficients):
    monkeypatch.setitem(KERNELS, "mixed", PolynomialKernel("mixed", "Mixed", "", coefficients))
    scene = replace(SCENES["ten_balls"](), field=meniscus.Field("mixed", 0.25))
    for projection in PROJECTIONS:
        camera = scene.camera(projection)
        judge(meniscus.render(scene.balls, camera, scene.field, method="tile_caster"), scene, camera)
