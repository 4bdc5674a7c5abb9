"""Both back-ends inside Blender's process: OpenGL in a context of its own, and the CPU."""

from __future__ import annotations

import numpy as np
import pytest


def _image(meniscus, method):
    positions = np.random.default_rng(8).random((30, 3)) - 0.5
    balls = meniscus.Balls(positions, 0.35, colors=np.abs(positions))
    camera = meniscus.Camera.perspective((1, -3, 1), (0, 0, 0), fov_y=0.5, width=64, height=48)
    return meniscus.render(balls, camera, meniscus.Field(), method=method, passes=("depth", "normal", "combined"))


GPU_METHODS = ("tile_lists", "fitted_bvh", "depth_peeling")


@pytest.mark.parametrize("method", GPU_METHODS)
def test_methods_on_opengl_see_what_the_cpu_sees(meniscus, method):
    found, exact = _image(meniscus, method), _image(meniscus, "tile_caster")
    assert 0.1 < exact.hit.mean() < 0.9
    np.testing.assert_array_equal(found.hit, exact.hit)
    for name in ("depth", "normal", "combined"):
        np.testing.assert_allclose(found[name], exact[name], atol=2e-4)


@pytest.mark.parametrize("method", GPU_METHODS)
def test_rendering_again_and_again_gives_the_same(meniscus, method):
    first = _image(meniscus, method)
    for _ in range(5):
        np.testing.assert_array_equal(_image(meniscus, method)["depth"], first["depth"])


def test_every_method_says_whether_it_runs_here(meniscus):
    problems = {status.name: status.problem for status in meniscus.methods()}
    assert {*GPU_METHODS, "tile_caster"} <= problems.keys()
    assert not any(problems.values()), problems
