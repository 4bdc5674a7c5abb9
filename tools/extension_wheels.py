"""The wheels that travel in the extension: moderngl, glcontext and OpenEXR for every platform and Python it runs on, and the
native core for every platform.

A new platform is a row in `PLATFORMS` and in `native_wheels.TARGETS`, a new Python an entry in `PYTHONS`; `make lock` then
rewrites the manifest's list.
"""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

import native_wheels
import tomllib
from environments import UV_FOLDER, ensure_uv
from project import CACHE, REQUIREMENTS, ROOT, ToolError, fingerprint, locked, output_of

MANIFEST = ROOT / "blender_manifest.toml"
LOCK = REQUIREMENTS / "extension.txt"
DOWNLOADS = CACHE / "extension-wheels"

# Blender's name of a platform, and the wheel tags that run on it.
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "macos-arm64": ("macosx_11_0_arm64",),
    "windows-x64": ("win_amd64",),
}

# Blender 4.2 to 5.0 have Python 3.11, 5.1 and 5.2 have 3.13; Linux distributions build Blender with newer ones.
PYTHONS = ("3.11", "3.13", "3.14")


def collect() -> list[Path]:
    """All wheels, downloaded or built where the cache has them not; sorted by name."""
    return sorted([*download(), *native_wheels.build_all()], key=lambda wheel: wheel.name)


def names() -> list[str]:
    """What `collect` gives, without building anything."""
    return sorted([*(wheel.name for wheel in download()), *map(native_wheels.wheel_name, PLATFORMS)])


def download() -> list[Path]:
    """The wheels of others, from the cache where they are there already."""
    stamp = DOWNLOADS / fingerprint(LOCK, Path(__file__))
    with locked("extension-wheels"):
        if not stamp.is_dir():
            ensure_uv()
            with ThreadPoolExecutor(4) as pool:
                folders = list(pool.map(lambda row: download_for(*row), product(PLATFORMS.values(), PYTHONS)))
            partial = stamp.with_suffix(".partial")
            partial.mkdir(exist_ok=True)
            for wheel in (wheel for folder in folders for wheel in folder.glob("*.whl")):
                wheel.replace(partial / wheel.name)
            partial.rename(stamp)
    return list(stamp.glob("*.whl"))


def download_for(tags: tuple[str, ...], python: str) -> Path:
    """Download the wheels of one platform and Python; pip checks their hashes."""
    folder = DOWNLOADS / f"{tags[0]}-{python}"
    command: list[str | Path] = [
        UV_FOLDER / "bin" / "python",
        "-m",
        "pip",
        "download",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
    ]
    command += ["--require-hashes", "--only-binary", ":all:", "--python-version", python]
    command += [word for tag in tags for word in ("--platform", tag)]
    output_of([*command, "-r", LOCK, "-d", folder])
    return folder


def manifest() -> dict[str, object]:
    return tomllib.loads(MANIFEST.read_text())


def check_manifest() -> None:
    """Fail where the manifest lists other wheels or platforms than this file, the lock list and native/ say."""
    listed = manifest()
    if listed["wheels"] != [f"./wheels/{name}" for name in names()] or listed["platforms"] != list(PLATFORMS):
        raise ToolError(
            "The wheels in blender_manifest.toml are not those of requirements/extension.txt and native/: run 'make lock'."
        )


def write_manifest() -> None:
    """Bring the manifest's lists of wheels and platforms up to date."""
    lines = "".join(f'  "./wheels/{name}",\n' for name in names())
    text = re.sub(r"^wheels = \[.*?\]", f"wheels = [\n{lines}]", MANIFEST.read_text(), flags=re.MULTILINE | re.DOTALL)
    platforms = ", ".join(f'"{platform}"' for platform in PLATFORMS)
    MANIFEST.write_text(re.sub(r"^platforms = \[.*?\]", f"platforms = [{platforms}]", text, flags=re.MULTILINE))
