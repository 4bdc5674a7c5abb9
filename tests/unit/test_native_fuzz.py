"""The native module takes anything: it gives a result, or raises an exception with a sentence, and never ends the process.

`make fuzz` tries many more cases than the test run.
"""

import inspect
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import meniscus_native
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

# The test run tries the same cases each time; `make fuzz` asks for other ones, and more.
CASES = int(os.environ.get("MENISCUS_FUZZ_CASES", "0"))
EFFORT: dict[str, Any] = {"max_examples": CASES} if CASES else {"max_examples": 200, "derandomize": True}

EXPECTED = (TypeError, ValueError, OverflowError, MemoryError)

Arguments = dict[str, Any]


@dataclass(frozen=True)
class Sizes:
    """What the arrays of a call have in common."""

    balls: int
    rays: int
    width: int
    height: int


SIZES = st.builds(Sizes, st.integers(0, 12), st.integers(0, 6), st.integers(1, 40), st.integers(1, 40))

WILD = (float("nan"), float("inf"), -1.0, 0.0, 1e-30, 1e30)


def array(dtype: str, low: float, high: float, *shape: int) -> st.SearchStrategy[np.ndarray]:
    """Numbers from a range; in one of four arrays, one number that may be unusable."""
    return st.builds(filled, st.integers(0, 2**32 - 1), st.just(dtype), st.just((low, high)), st.just(shape))


def filled(seed: int, dtype: str, numbers: tuple[float, float], shape: tuple[int, ...]) -> np.ndarray:
    random = np.random.default_rng(seed)
    values = random.uniform(*numbers, shape).astype(dtype)
    if values.size and values.dtype.kind == "f" and random.random() < 0.25:
        values.flat[random.integers(values.size)] = random.choice(WILD)
    return values


def raising(share: float) -> None:
    raise ValueError(f"given up at {share}")


VECTOR = st.tuples(*[st.floats(-2, 2, width=32)] * 3)
LIGHTS = st.tuples(
    st.sampled_from(["SUN", "POINT", "SPOT", "AREA"]),
    VECTOR,
    VECTOR,
    VECTOR,
    st.floats(0, 2, width=32),
    st.tuples(st.floats(0, 1, width=32), st.floats(0, 1, width=32)),
    st.floats(0, 1, width=32),
    st.tuples(st.floats(0, 2, width=32), st.floats(0, 2, width=32)),
    VECTOR,
    st.booleans(),
    st.booleans(),
)
TRACING = st.tuples(
    *[st.integers(0, 3)] * 2,
    st.booleans(),
    st.integers(0, 3),
    st.floats(0, 9, width=32) | st.just(float("nan")),
    st.integers(0, 2),
)


def views(sizes: Sizes) -> st.SearchStrategy[tuple[Any, ...]]:
    """A camera as one argument."""
    eye = array("f8", -2, 2, 3).map(lambda numbers: numbers.tolist())
    fixed = np.eye(3).tolist(), [-1.0, 1.0, -1.0, 1.0], [0.125, 8.0]
    return st.builds(lambda at, flag: (fixed[0], at, fixed[1], flag, sizes.width, sizes.height, fixed[2]), eye, st.booleans())


def traced_fluid(positions: np.ndarray, radii: np.ndarray, colors: np.ndarray, materials: np.ndarray) -> tuple[Any, ...]:
    """Balls as light meets them; those that the tree refuses have one that is empty."""
    kernel, weights = [0, 0, 5 / 9, 4 / 9], np.ones(len(radii), np.float32)
    try:
        return meniscus_native.FittedBvh(positions, radii, weights, kernel, 0.2), radii, colors, materials
    except ValueError:
        none = np.empty((0, 3), np.float32)
        return meniscus_native.FittedBvh(none, none[:, 0].copy(), none[:, 0].copy(), kernel, 0.2), radii, colors, materials


def seeded_particles(positions: np.ndarray, radii: np.ndarray, weights: np.ndarray) -> Any:
    """Surface particles on balls, on none where these are unusable; or such that were not seeded."""
    particles = meniscus_native.SurfaceParticles(count=0, cell_share=0.3, steps=1, disperses=True, fills_gaps=True, seed=1)
    with suppress(ValueError):
        particles.go(positions, radii, weights, [0, 0, 5 / 9, 4 / 9], 0.2)
    return particles


def traced_meshes(vertices: np.ndarray, triangles: np.ndarray, normals: np.ndarray, materials: np.ndarray) -> tuple[Any, ...]:
    """Triangles as light meets them, moved to the origin where their vertices are unusable."""
    usable = np.where(np.isfinite(vertices), vertices, 0)
    return meniscus_native.Triangles(usable, triangles), normals, materials


# For each parameter's name: what fits it.
FITTING: dict[str, Callable[[Sizes], st.SearchStrategy[Any]]] = {
    "positions": lambda sizes: array("f4", -2, 2, sizes.balls, 3),
    "radii": lambda sizes: array("f4", 0.1, 2, sizes.balls),
    "weights": lambda sizes: array("f4", -1, 2, sizes.balls),
    "kernel": lambda sizes: st.sampled_from([[0, 0, 5 / 9, 4 / 9], [0, 1], [0, 0, 0, 0, 1]]),
    "isovalue": lambda sizes: st.sampled_from([0.05, 0.4, 1.5]),
    "origins": lambda sizes: array("f8", -2, 2, sizes.rays, 3),
    "directions": lambda sizes: array("f8", -2, 2, sizes.rays, 3),
    "t_min": lambda sizes: array("f8", 0, 1, sizes.rays),
    "t_max": lambda sizes: array("f8", 1, 9, sizes.rays),
    "camera_from_world": lambda sizes: st.just(np.eye(3).tolist()) | array("f8", -1, 1, 3, 3),
    "eye": lambda sizes: array("f8", -2, 2, 3).map(list),
    "window": lambda sizes: st.just([-1.0, 1.0, -1.0, 1.0]),
    "width": lambda sizes: st.just(sizes.width),
    "height": lambda sizes: st.just(sizes.height),
    "clip": lambda sizes: st.just([0.125, 8.0]),
    "depth": lambda sizes: array("f4", 0, 1, sizes.height, sizes.width),
    "normal": lambda sizes: array("f4", 0, 1, sizes.height, sizes.width, 3),
    "ball": lambda sizes: st.none() | array("i4", -1, 9, sizes.height, sizes.width),
    "attributes": lambda sizes: st.lists(
        st.tuples(array("f4", 0, 1, sizes.balls, 3), array("f4", 0, 1, sizes.height, sizes.width, 3)), max_size=2
    ),
    "centers": lambda sizes: array("f4", -2, 2, sizes.balls, 3),
    "extents": lambda sizes: array("f4", 0.1, 2, sizes.balls) | array("f4", -1, 1, sizes.balls, 9),
    "names": lambda sizes: array("i4", 0, 9, sizes.balls),
    "name": lambda sizes: array("i4", -1, 9, sizes.height, sizes.width),
    "background": lambda sizes: st.just(1e10),
    "stride": lambda sizes: st.sampled_from([4, 2, 1]),
    "vertices": lambda sizes: array("f4", -2, 2, sizes.balls, 3),
    "triangles": lambda sizes: array("i4", 0, max(sizes.balls, 1), sizes.rays, 3),
    "normals": lambda sizes: array("f4", -1, 1, sizes.rays, 9),
    "triangle": lambda sizes: array("i4", 0, 1, sizes.height, sizes.width),
    "rgba": lambda sizes: array("f4", 0, 1, sizes.height, sizes.width, 4),
    "vector": lambda sizes: st.none() | array("f4", 0, 1, sizes.height, sizes.width, 4),
    "speed": lambda sizes: st.none() | array("f4", 0, 1, sizes.height, sizes.width),
    "table": lambda sizes: array("f4", 0, 9, 10),
    "image": lambda sizes: array("f4", 0, 1, sizes.height, sizes.width),
    "facing": lambda sizes: st.none() | array("f4", 0, 1, sizes.height, sizes.width),
    "contrast": lambda sizes: st.none() | array("f4", 0, 1, sizes.height, sizes.width),
    "color": lambda sizes: array("f4", 0, 1, sizes.height, sizes.width, 3),
    "velocity": lambda sizes: st.none() | array("f4", 0, 1, sizes.height, sizes.width, 3),
    "to_previous": lambda sizes: st.none() | array("f4", 0, 1, sizes.height, sizes.width, 3),
    "to_following": lambda sizes: st.none() | array("f4", 0, 1, sizes.height, sizes.width, 3),
    "elsewhere": lambda sizes: array("f4", -2, 2, sizes.balls, 3),
    "displacement": lambda sizes: array("f4", 0, 1, sizes.height, sizes.width, 3),
    "position": lambda sizes: st.none() | array("f4", 0, 1, sizes.height, sizes.width, 3),
    "material": lambda sizes: array("i4", -2, 3, sizes.height, sizes.width),
    "radiance": lambda sizes: array("f4", 0, 1, sizes.balls, 3),
    "point_normals": lambda sizes: array("f4", -1, 1, sizes.balls, 3),
    "to_eyes": lambda sizes: array("f4", -1, 1, sizes.balls, 3),
    "point_colors": lambda sizes: array("f4", 0, 1, sizes.balls, 3),
    "point_materials": lambda sizes: array("i4", 0, 2, sizes.balls),
    "materials": lambda sizes: st.lists(
        st.tuples(*[st.floats(0, 2, width=32)] * 4, st.just((0.0, 0.5, 1.0)), VECTOR, VECTOR), min_size=1, max_size=3
    ),
    "lights": lambda sizes: st.lists(LIGHTS, max_size=3),
    "world": lambda sizes: array("f4", 0, 1, 3).map(lambda numbers: numbers.tolist()),
    "pixels": lambda sizes: array("f4", 0, 1, sizes.height, sizes.width, 3),
    "fluid": lambda sizes: st.builds(
        traced_fluid,
        *(array("f4", low, 2, sizes.balls, *shape) for low, shape in ((-2, (3,)), (0.1, ()), (0.1, (3,)))),
        array("i4", 0, 2, sizes.balls),
    ),
    "meshes": lambda sizes: st.builds(
        traced_meshes,
        array("f4", -2, 2, 9, 3),
        array("i4", 0, 9, sizes.rays, 3),
        array("f4", -1, 1, sizes.rays, 9),
        array("i4", 0, 2, sizes.rays),
    ),
    "distant": lambda sizes: st.builds(
        lambda color, pixels: (
            color.tolist(),
            None if pixels is None else meniscus_native.WorldImage(pixels),
            np.eye(3).tolist(),
        ),
        array("f4", 0, 1, 3),
        st.none() | st.just(np.ones((2, 4, 3), np.float32)),
    ),
    "tracing": lambda sizes: TRACING,
    "particles": lambda sizes: st.builds(
        seeded_particles, *(array("f4", low, 2, sizes.balls, *shape) for low, shape in ((-2, (3,)), (0.3, ()), (-1, ())))
    ),
    "scales": lambda sizes: array("f4", 0.1, 2, sizes.balls),
    "reach": lambda sizes: st.floats(0.125, 2, width=32),
    "step": lambda sizes: st.integers(0, 2**32 - 1),
    "company": lambda sizes: st.floats(0, 99, width=32),
    "number": lambda sizes: st.integers(0, 2**32 - 1),
    "seconds": lambda sizes: st.floats(allow_nan=True, width=32),
    "behind": lambda sizes: st.none() | st.tuples(*[st.floats(width=32)] * 4),
    "velocities": lambda sizes: st.none() | array("f4", -2, 2, sizes.balls, 3),
    "points": lambda sizes: st.none() | array("f4", -2, 2, sizes.rays, 3),
    "count": lambda sizes: st.integers(1, 40),
    "cell_share": lambda sizes: st.sampled_from([0.05, 0.3, 1.0]),
    "steps": lambda sizes: st.integers(0, 3),
    "seed": lambda sizes: st.integers(0, 2**32 - 1),
    "most": lambda sizes: st.integers(0, 2**32 - 1),
    "threads": lambda sizes: st.integers(0, 3),
    "watch": lambda sizes: st.none() | st.just(lambda share: None) | st.just(raising),
}
FLAGS = (
    "is_perspective",
    "overlapping",
    "fits",
    "tightens",
    "discards",
    "proves",
    "is_film_clear",
    "disperses",
    "fills_gaps",
    "is_exact",
)
FITTING["coefficients"] = FITTING["kernel"]
FITTING |= dict.fromkeys(("view", "previous", "following"), views)
FITTING |= {name: lambda sizes: st.booleans() for name in FLAGS}


def strided(values: np.ndarray) -> st.SearchStrategy[np.ndarray]:
    """The same array as memory may hold it otherwise."""
    packed = np.zeros(values.shape, np.dtype([("skipped", "u1"), ("value", values.dtype)]))
    read_only = values.copy()
    read_only.flags.writeable = False
    layouts = [
        packed["value"],
        unaligned(values),
        read_only,
        values[::-1],
        values[..., ::2],
        values.T,
        np.asfortranarray(values),
    ]
    return st.sampled_from([*layouts, values.astype(values.dtype.newbyteorder()), values.tolist()])


def unaligned(values: np.ndarray) -> np.ndarray:
    """A copy that begins at an odd address."""
    room = np.zeros(values.nbytes + 2, np.uint8)
    begin = 1 - room.ctypes.data % 2
    copy = room[begin : begin + values.nbytes].view(values.dtype).reshape(values.shape)
    copy[...] = values
    return copy


DTYPES = ["f4", "f8", "f2", ">f4", "i4", "u8", "?", "c8", "U3", "M8[s]", "O"]
ARRAYS = st.builds(np.zeros, st.lists(st.integers(0, 5), max_size=4), st.sampled_from(DTYPES))
# No number of pixels that is allowed and would take gigabytes.
NUMBERS = st.sampled_from([-1, 0, 1, 3, 2000, 2**16, 2**31, 2**64, -(2**63), 0.5, -0.0, 1e300, float("inf"), float("nan"), 1j])
ANYTHING = st.none() | st.text(max_size=3) | st.binary(max_size=3) | NUMBERS | ARRAYS | st.lists(NUMBERS, max_size=5)
ANYTHING |= st.just(object())


def parameters(called: Callable[..., Any]) -> list[str]:
    return [name for name in inspect.signature(called).parameters if name != "self"]


def calls() -> dict[str, tuple[type | None, Callable[..., Any]]]:
    """Everything in the module that can be called, with the class that it is a method of."""
    members = {name: member for name, member in vars(meniscus_native).items() if callable(member)}
    found = {name: (None, member) for name, member in members.items()}
    for name, owner in members.items():
        if isinstance(owner, type):
            methods = {method: member for method, member in vars(owner).items() if not method.startswith("_")}
            found |= {f"{name}.{method}": (owner, member) for method, member in methods.items() if callable(member)}
    return found


def fitting(draw: Any, called: Callable[..., Any], sizes: Sizes) -> Arguments:
    return {name: draw(FITTING[name](sizes)) for name in parameters(called)}


def spoil(draw: Any, arguments: Arguments) -> None:
    """Replace up to two arguments by anything, or by the same array laid out otherwise."""
    for name in draw(st.lists(st.sampled_from(sorted(arguments)), max_size=2, unique=True)) if arguments else ():
        value = arguments[name]
        arguments[name] = draw(strided(value) | ANYTHING if isinstance(value, np.ndarray) and value.size else ANYTHING)


def call(called: Callable[..., Any], *bound: Any, **arguments: Any) -> Any:
    """Its result, or None where it raises what it may raise."""
    try:
        return called(*bound, **arguments)
    except EXPECTED as error:
        sentence = str(error)
    assert sentence
    return None


@pytest.mark.slow
@pytest.mark.parametrize("name", calls())
@given(data=st.data())
@settings(**EFFORT, deadline=None, database=None, suppress_health_check=list(HealthCheck))
def test_anything_gives_a_result_or_an_exception_with_a_sentence(name: str, data: Any):
    owner, called = calls()[name]
    sizes = data.draw(SIZES)
    of_owner = fitting(data.draw, owner, sizes) if owner else {}
    arguments = fitting(data.draw, called, sizes)
    spoil(data.draw, arguments)
    bound = [call(owner, **of_owner)] if owner else []
    if bound != [None]:
        call(called, *bound, **arguments)


@pytest.mark.parametrize("name", ["positions", "radii", "weights", "origins", "directions"])
def test_an_array_at_an_odd_address_is_refused(name: str):
    arrays = {
        "positions": np.zeros((1, 3), "f4"),
        "radii": np.ones(1, "f4"),
        "weights": np.ones(1, "f4"),
        "origins": np.zeros((1, 3)),
        "directions": np.ones((1, 3)),
    }
    arrays[name] = unaligned(arrays[name])
    with pytest.raises(ValueError, match=f"the numbers of {name} must be aligned"):
        meniscus_native.oracle_cast(**arrays, kernel=[0, 1], isovalue=0.5)


def test_more_threads_than_a_system_bears_are_refused():
    one, rays = np.ones(1, "f4"), np.ones((1, 3))
    with pytest.raises(ValueError, match="at most 1024"):
        meniscus_native.oracle_cast(np.zeros((1, 3), "f4"), one, one, [0, 1], 0.5, rays, rays, threads=1025)
