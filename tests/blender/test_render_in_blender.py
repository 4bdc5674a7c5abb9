"""Both back-ends inside Blender's process: OpenGL in a context of its own, and the CPU."""

from __future__ import annotations

import numpy as np


def _image(meniscus, method):
    positions = np.random.default_rng(8).random((30, 3)) - 0.5
    balls = meniscus.Balls(positions, 0.35, colors=np.abs(positions))
    camera = meniscus.Camera.perspective((1, -3, 1), (0, 0, 0), fov_y=0.5, width=64, height=48)
    return meniscus.render(balls, camera, meniscus.Field(), method=method, passes=("depth", "normal", "combined"))


def test_depth_peeling_sees_what_the_exact_method_sees(meniscus):
    peeled, exact = _image(meniscus, "depth_peeling"), _image(meniscus, "tile_caster")
    assert 0.1 < exact.hit.mean() < 0.9
    np.testing.assert_array_equal(peeled.hit, exact.hit)
    for name in ("depth", "normal", "combined"):
        np.testing.assert_allclose(peeled[name], exact[name], atol=2e-4)


def test_rendering_again_and_again_gives_the_same(meniscus):
    first = _image(meniscus, "depth_peeling")
    for _ in range(5):
        np.testing.assert_array_equal(_image(meniscus, "depth_peeling")["depth"], first["depth"])


def test_every_method_says_whether_it_runs_here(meniscus):
    problems = {status.name: status.problem for status in meniscus.methods()}
    assert problems == {"depth_peeling": "", "tile_caster": ""}
