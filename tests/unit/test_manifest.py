"""The extension's manifest agrees with the package and with the locked wheels."""

import re
import tomllib
from itertools import product
from pathlib import Path

import pytest

import meniscus

ROOT = Path(meniscus.__file__).parent
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
LOCK = (ROOT / "requirements" / "extension.txt").read_text()
NATIVE_VERSION = tomllib.loads((ROOT / "native" / "Cargo.toml").read_text())["workspace"]["package"]["version"]


def test_version_is_the_packages_and_the_native_cores():
    assert MANIFEST["version"] == meniscus.__version__ == NATIVE_VERSION


def test_only_locked_versions_are_listed():
    locked = {f"{name.lower()}-{version}" for name, version in re.findall(r"^([\w-]+)==([\w.]+)", LOCK, re.MULTILINE)}
    listed = {"-".join(Path(wheel).name.split("-")[:2]).lower() for wheel in MANIFEST["wheels"]}
    assert listed == locked | {f"meniscus_native-{NATIVE_VERSION}"}


@pytest.mark.parametrize(
    ("package", "python", "system"),
    list(product(["moderngl", "glcontext", "openexr"], ["cp311", "cp313", "cp314"], ["manylinux", "macosx", "win_amd64"])),
)
def test_every_package_has_a_wheel_for_every_python_and_system(package, python, system):
    found = [
        wheel for wheel in MANIFEST["wheels"] if re.match(rf"\./wheels/{package}-[\d.]+-{python}-{python}-\S*{system}", wheel)
    ]
    assert len(found) == 1


@pytest.mark.parametrize("tag", ["manylinux_2_28_x86_64", "macosx_11_0_arm64", "win_amd64"])
def test_the_native_core_has_one_wheel_a_system_for_every_python(tag):
    assert MANIFEST["wheels"].count(f"./wheels/meniscus_native-{NATIVE_VERSION}-cp311-abi3-{tag}.whl") == 1


def test_all_environments_pin_the_same_opengl_and_openexr_as_the_extension():
    for lock in (*(ROOT / "requirements").glob("bpy-*.txt"), *(ROOT / "requirements").glob("development-*.txt")):
        text = lock.read_text()
        for pin in re.findall(r"^\S+==\S+", LOCK, re.MULTILINE):
            assert f"{pin} " in text, f"{lock.name} does not pin {pin}"


def test_requirements_name_no_host():
    for listing in (ROOT / "requirements").iterdir():
        assert not re.search(r"https?:|--index-url|--find-links", listing.read_text()), listing.name
