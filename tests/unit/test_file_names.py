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


VALUES = {"scene_name": "Sea/Shore #2", "blend_dir": Path("/shots/07"), "fps": 24 / 1.001, "resolution_x": 1920, "dots": ".."}


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("/out/{scene_name}/{{v1}}_{pass}_####.exr", "/out/Sea_Shore _2/{v1}_{pass}_####.exr"),
        ("{blend_dir}{dots}/f.exr", "/shots/07/_./f.exr"),
        ("{resolution_x}_{resolution_x:######}_{resolution_x:.##}", "1920_001920_1920.00"),
        ("{fps}_{fps:###}_{fps:.###}_{fps:###.##}", f"{24 / 1.001}_024_23.976_023.98"),
    ],
)
def test_tokens_become_their_values(pattern, expected):
    assert expanded(pattern, VALUES) == expected


@pytest.mark.parametrize(
    ("pattern", "sentence"),
    [
        ("/out/{sceen}.exr", r"Unknown token \{sceen\} .*choose from \{scene_name\}, .*\{pass\}"),
        ("/out/{fps:2f}.exr", r"Unknown format in the token \{fps:2f\}: numbers can have ###, \.## or ###\.##"),
        ("/out/{fps:}.exr", r"Unknown format in the token \{fps:\}"),
        ("/out/{scene_name:##}.exr", r"Unknown format in the token \{scene_name:##\}"),
        ("/out/{fps.exr", r"A '\{' without its partner .*: write '\{\{' for a brace"),
        ("/out/fps}.exr", r"A '\}' without its partner"),
    ],
)
def test_tokens_that_make_no_sense_are_told(pattern, sentence):
    with pytest.raises(InputError, match=sentence):
        expanded(pattern, VALUES)


@pytest.mark.parametrize(
    ("pattern", "name", "expected"),
    [
        ("/a/{pass}/f_####.exr", "Ball ID", "/a/Ball ID/f_####.exr"),
        ("/a/f_####.exr", "Depth", "/a/f_Depth_####.exr"),
        ("/a/f.exr", "Depth", "/a/f_Depth.exr"),
        ("/a/f####.exr", "Depth", "/a/f_Depth####.exr"),
        ("/a/####.exr", "Depth", "/a/Depth_####.exr"),
        ("/a/f_{pass}_####.exr", None, "/a/f_####.exr"),
        ("/a/f_####.exr", None, "/a/f_####.exr"),
        ("/a/{pass}.exr", None, "/a/passes.exr"),
    ],
)
def test_passes_in_files_of_their_own_have_their_names(pattern, name, expected):
    assert pass_pattern(pattern, name) == expected
