"""File names with a frame number in them."""

from pathlib import Path

import pytest

from meniscus.addon.output.frame_path import frame_path, numbered_pattern


@pytest.mark.parametrize(
    ("pattern", "frame", "expected"),
    [
        ("/a/fluid_####.exr", 7, "/a/fluid_0007.exr"),
        ("/a/fluid_##.exr", 1234, "/a/fluid_1234.exr"),
        ("/a/fluid_####.exr", -7, "/a/fluid_-0007.exr"),
        ("/a##/v#_###.exr", 7, "/a##/v#_007.exr"),
        ("/a##/still.exr", 7, "/a##/still.exr"),
    ],
)
def test_the_last_hashes_of_the_file_name_become_the_frame_number(pattern: str, frame: int, expected: str) -> None:
    assert frame_path(pattern, frame) == Path(expected)


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [("/a#/fluid.exr", "/a#/fluid####.exr"), ("/a/fluid_#.v2.exr", "/a/fluid_#.v2.exr"), ("/a/b.v2.exr", "/a/b.v2####.exr")],
)
def test_a_name_without_hashes_gets_some(pattern: str, expected: str) -> None:
    assert numbered_pattern(pattern) == expected
