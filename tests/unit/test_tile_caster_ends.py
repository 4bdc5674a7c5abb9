"""Casting comes to an end also where radii are small against the rounding of distances."""

import subprocess
import sys

import pytest

# In a process of its own, which can be ended: arguments are the radius, the distance, the stride and the kernel's power.
CAST = """
import sys
import meniscus_native
import numpy as np

radius, distance, stride, power = float(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
random = np.random.default_rng(1)
positions = random.uniform(-1, 1, (400, 3)) * np.array([8, 8, 2]) * radius + np.array([0, 0, distance])
half = 8 * radius / distance
caster = meniscus_native.TileCaster(
    positions.astype("f4"), np.full(400, radius, "f4"), np.ones(400, "f4"), [0] * power + [1], 0.3,
    camera_from_world=np.eye(3).tolist(), eye=[0, 0, 0], window=[-half, half, -half, half], is_perspective=True,
    width=64, height=64, clip=[0.01 * distance, 10 * distance])
depth, normal = np.zeros((64, 64), "f4"), np.zeros((64, 64, 3), "f4")
caster.cast(depth, normal, background=1e10, stride=stride)
print((depth < 1e9).mean())
"""


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize(("radius", "distance"), [(1, 1000), (1e-3, 1000), (1e-10, 10)])
def test_casting_ends(radius, distance, stride, power):
    command = [sys.executable, "-c", CAST, *map(str, (radius, distance, stride, power))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    # Seen from so near that radii are above the rounding, the fluid covers nine tenths of the image.
    assert radius < 1e-6 * distance or float(done.stdout) > 0.8
