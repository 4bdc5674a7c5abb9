"""Builds the extension: dist/meniscus-VERSION.zip, with its wheels, by Blender's own packaging tool.

.venv/bin/python tools/build_extension.py
"""

from __future__ import annotations

import importlib.util
import shutil
import sys
from pathlib import Path

import extension_wheels
from project import ROOT, ToolError, command_line, output_of, run


def build() -> Path:
    """Build the zip, validate it, and return its path."""
    extension_wheels.check_manifest()
    place_wheels(extension_wheels.collect())
    target = ROOT / "dist" / f"meniscus-{extension_wheels.manifest()['version']}.zip"
    target.parent.mkdir(exist_ok=True)
    packager, tags = blender_packager()
    valid_tags: list[str | Path] = ["--valid-tags", tags]
    output_of([sys.executable, packager, "build", "--source-dir", ROOT, "--output-filepath", target, *valid_tags])
    run([sys.executable, packager, "validate", target, *valid_tags])
    return target


def place_wheels(wheels: list[Path]) -> None:
    """Fill wheels/ with exactly these: Blender's tool packs whatever lies there."""
    folder = ROOT / "wheels"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for wheel in wheels:
        shutil.copy(wheel, folder)


def blender_packager() -> tuple[Path, Path]:
    """Blender's packaging tool and its list of valid tags, from the bpy wheel of the development environment."""
    bpy = importlib.util.find_spec("bpy")
    if bpy is None or bpy.origin is None:
        raise ToolError("Blender's packaging tool is part of the development environment: run 'make extension'.")
    scripts = next(Path(bpy.origin).parent.glob("*.*/scripts"))
    return scripts / "addons_core/bl_pkg/cli/blender_ext.py", scripts / "modules/_bpy_internal/extensions/tags.py"


def main(arguments: list[str]) -> None:
    if arguments:
        raise ToolError("build_extension.py takes no arguments")
    target = build()
    print(f"Built {target.relative_to(ROOT)} ({target.stat().st_size / 1e6:.1f} MB)")


if __name__ == "__main__":
    command_line(main)
