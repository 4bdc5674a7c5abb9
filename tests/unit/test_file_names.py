"""File names with tokens and a frame number in them."""

from pathlib import Path

import pytest

from meniscus.addon.fluid.errors import InputError
from meniscus.addon.output.file_names import expanded, frame_path, numbered_pattern, pass_pattern


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


def test_tokens_become_their_values():
    values = {"scene_name": "Sea/Shore", "fps": "24"}
    assert expanded("/out/{scene_name}/{{v1}}_{fps}_{pass}_####.exr", values) == "/out/Sea_Shore/{v1}_24_{pass}_####.exr"


def test_an_unknown_token_is_told_with_those_there_are():
    with pytest.raises(InputError, match=r"Unknown token \{sceen\} .*choose from \{fps\}, \{pass\}"):
        expanded("/out/{sceen}.exr", {"fps": "24"})


@pytest.mark.parametrize(
    ("pattern", "name", "expected"),
    [
        ("/a/{pass}/f_####.exr", "Ball ID", "/a/Ball ID/f_####.exr"),
        ("/a/f_####.exr", "Depth", "/a/f_Depth_####.exr"),
        ("/a/f.exr", "Depth", "/a/f_Depth.exr"),
        ("/a/f####.exr", "Depth", "/a/f_Depth####.exr"),
        ("/a/f_{pass}_####.exr", None, "/a/f_####.exr"),
        ("/a/f_####.exr", None, "/a/f_####.exr"),
    ],
)
def test_passes_in_files_of_their_own_have_their_names(pattern, name, expected):
    assert pass_pattern(pattern, name) == expected
