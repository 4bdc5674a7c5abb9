"""The child process that renders with Meniscus, and tells what there is to render with."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache, lru_cache

import numpy as np

import meniscus
from bench.scenes import SCENES
from bench.worker import Message, serve
from meniscus.addon.fluid.errors import DeviceError
from meniscus.addon.render import native
from meniscus.addon.render.registry import gpu, runs_in_software_opengl


@lru_cache(maxsize=1)
def balls_of(scene: str) -> meniscus.Balls:
    return SCENES[scene].make_balls()


def prepare(request: Message) -> Message:
    """Make the balls, which may mean to bake a simulation."""
    return {"balls": len(balls_of(request["scene"]))}


def render(request: Message) -> Message:
    """Render once: the milliseconds of the stages and of the whole call, the number of balls, the share of pixels hit, and what
    the method counted.
    """
    if request["switches"]:
        use_switches(**request["switches"])
    balls = balls_of(request["scene"])
    field = request["field"] or SCENES[request["scene"]].field
    camera = SCENES[request["scene"]].camera(balls, request["width"], request["height"])
    start = time.perf_counter()
    image = meniscus.render(balls, camera, field, method=request["method"], threads=request["threads"])
    whole = (time.perf_counter() - start) * 1e3
    if request["save"]:
        np.savez(request["save"], depth=image["depth"], normal=image["normal"], hit=image.hit)
    return {
        "milliseconds": {**image.info.milliseconds, "render": whole},
        "balls": len(balls),
        "hit": float(image.hit.mean()),
        "counts": image.info.counts,
    }


@cache
def use_switches(**switches: bool) -> None:
    """From now on Depth Peeling has these options in this process, which serves no other."""
    from meniscus.gpu_shaders.context import shared_context
    from meniscus.gpu_shaders.methods.depth_peeling import method, options

    switched = method.DepthPeeling(shared_context(), options.Options(**switches))
    method.create = lambda: switched


def describe(request: Message) -> Message:
    """The methods, and whether they run here; the native core's processor paths; the OpenGL renderer."""
    methods = [
        {
            "name": status.name,
            "backend": status.backend,
            "problem": status.problem,
            "is_software": not status.problem and runs_in_software_opengl(status.info),
        }
        for status in meniscus.methods()
        if "metaballs" in status.info.displays
    ]
    return {"methods": methods, "simd_paths": _simd_paths(), "gl_renderer": _gl_renderer()}


def _simd_paths() -> list[str]:
    try:
        return list(native.load().simd_paths())
    except DeviceError:
        return []


def _gl_renderer() -> str:
    try:
        return str(gpu().shared_context().renderer)
    except DeviceError as error:
        return f"none: {error}"


ACTIONS: dict[str, Callable[[Message], Message]] = {"prepare": prepare, "render": render, "describe": describe}

if __name__ == "__main__":
    serve(lambda request: ACTIONS[request["do"]](request))
