"""Where the native core meets its limits it says so in a sentence, and the next call works."""

import subprocess
import sys

import meniscus_native
import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import CancelledError

# The address space is limited, so all of this happens in a process of its own. A hundred million balls take 1.6 GB, and the
# work twice as much again. Memory that is only read as zeros costs nothing, and radii serve as weights.
TOO_MANY_BALLS = """
import resource

import meniscus
import numpy as np
from meniscus.addon.fluid.errors import DeviceError

camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=64, height=48)
small = lambda: meniscus.render(meniscus.Balls([[0, 0, 0]], 1.0), camera, meniscus.Field(), method="tile_caster")
before = small()
count = 100_000_000
radii = np.ones(count, np.float32)
balls = meniscus.Balls(np.zeros((count, 3), np.float32), radii, radii)
with open("/proc/self/statm") as statm:
    used = int(statm.read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 1_000_000_000,) * 2)
try:
    meniscus.render(balls, camera, meniscus.Field(), method="tile_caster")
except DeviceError as error:
    print(type(error.__cause__).__name__, error)
after = small()
assert after["depth"].tobytes() == before["depth"].tobytes() and after.hit.any()
print("still works")
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the address space of a process")
def test_too_little_memory_for_a_hundred_million_balls():
    done = subprocess.run([sys.executable, "-c", TOO_MANY_BALLS], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    problem, closing = done.stdout.splitlines()
    assert problem.startswith("MemoryError There is not enough memory: at least ")
    assert problem.endswith("use fewer balls")
    assert closing == "still works"


def long_cast() -> tuple[meniscus.Balls, meniscus.Camera]:
    """Balls so thin that every ray looks at hundreds of them and finds nothing: it takes minutes."""
    positions = np.random.default_rng(1).random((3000, 3)) * 0.1
    camera = meniscus.Camera.perspective((0.05, -1, 0.05), (0.05, 0, 0.05), fov_y=0.5, width=8192, height=8192)
    return meniscus.Balls(positions, 1.0, weights=7e-4), camera


def test_cancelling_amid_a_long_cast_raises_what_the_caller_raised():
    balls, camera = long_cast()
    given_up = CancelledError("given up")
    asked = []

    def give_up(share: float) -> None:
        asked.append(share)
        if len(asked) > 20:
            raise given_up

    with pytest.raises(CancelledError) as caught:
        meniscus.render(balls, camera, meniscus.Field(), method="tile_caster", passes=("depth",), on_progress=give_up)
    assert caught.value is given_up
    # It is not asked again, and it was amid the work.
    assert len(asked) == 21
    assert asked[-1] < 1
    small = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=8, height=6)
    assert meniscus.render(meniscus.Balls([[0, 0, 0]], 1.0), small, meniscus.Field(), method="tile_caster").hit.any()


def caster_arguments() -> dict:
    return {
        "positions": np.zeros((2, 3), "f4"),
        "radii": np.ones(2, "f4"),
        "weights": np.ones(2, "f4"),
        "kernel": [0, 1],
        "isovalue": 0.5,
        "camera_from_world": [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        "eye": [0, -4, 0],
        "window": [-0.5, 0.5, -0.5, 0.5],
        "is_perspective": True,
        "width": 8,
        "height": 6,
        "clip": [0.1, 10],
    }


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"positions": np.zeros((2, 2), "f4")}, r"positions must be .* of the shape \(N, 3\), not of the shape \(2, 2\)"),
        ({"positions": np.zeros((2, 3))}, r"positions must be .*float32.*, not of float64"),
        ({"positions": np.zeros((4, 3), "f4")[::2]}, r"positions must be a C-contiguous .*, not with the strides \[24, 4\]"),
        ({"positions": [[0, 0, 0]]}, "positions must be .*, not a list"),
        ({"positions": np.full((2, 3), np.nan, "f4")}, "positions must be finite"),
        ({"radii": np.ones(3, "f4")}, "one number for each of the 2 positions, not 3 and 2"),
        ({"radii": np.zeros(2, "f4")}, "radii must be finite and greater than zero"),
        ({"radii": np.full(2, np.inf, "f4")}, "radii must be finite and greater than zero"),
        ({"weights": np.full(2, np.nan, "f4")}, "weights must be finite"),
        ({"kernel": [0, 2]}, "a kernel has 2 to 5 coefficients"),
        ({"window": [0, 0, 1, 2]}, "the camera shows an empty rectangle"),
        ({"eye": [0, np.inf, 0]}, "the camera has a number that is not finite"),
        ({"width": 0}, "the camera must have from 1 to 65535 pixels a side"),
        ({"clip": [2, 1]}, "the camera must have a clip start"),
    ],
)
def test_unusable_arguments_are_refused_with_a_sentence(changed, sentence):
    with pytest.raises(ValueError, match=sentence):
        meniscus_native.TileCaster(**caster_arguments() | changed)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"depth": np.zeros((8, 6), "f4")}, r"depth must be .* of the shape \(6, 8\), not of the shape \(8, 6\)"),
        ({"depth": np.zeros((6, 8))}, "depth must be .*float32.*, not of float64"),
        ({"normal": np.zeros((6, 16, 3), "f4")[:, ::2]}, "normal must be a C-contiguous"),
        ({"ball": np.zeros((6, 8), "i8")}, "ball must be .*int32.*, not of int64"),
        ({"attributes": [(np.zeros((1, 3), "f4"), np.zeros((6, 8, 3), "f4"))]}, "attributes must have 2 rows, .*, not 1"),
        ({"stride": 3}, "the stride must be one of"),
    ],
)
def test_unusable_images_are_refused_with_a_sentence(changed, sentence):
    caster = meniscus_native.TileCaster(**caster_arguments())
    images = {"depth": np.zeros((6, 8), "f4"), "normal": np.zeros((6, 8, 3), "f4"), "background": 1e10}
    with pytest.raises(ValueError, match=sentence):
        caster.cast(**images | changed)


def test_no_balls_are_no_error():
    none = {"positions": np.zeros((0, 3), "f4"), "radii": np.zeros(0, "f4"), "weights": np.zeros(0, "f4")}
    depth, normal = np.zeros((6, 8), "f4"), np.ones((6, 8, 3), "f4")
    meniscus_native.TileCaster(**caster_arguments() | none).cast(depth, normal, background=1e10)
    assert np.all(depth == np.float32(1e10))
    assert not normal.any()
    t, normals = meniscus_native.oracle_cast(
        **none, kernel=[0, 1], isovalue=0.5, origins=np.zeros((2, 3)), directions=np.ones((2, 3))
    )
    assert np.all(np.isinf(t))
    assert not normals.any()
