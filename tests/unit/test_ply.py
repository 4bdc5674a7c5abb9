"""Points in PLY files."""

import struct

import numpy as np
import pytest

from meniscus.addon.fluid.errors import OutputError
from meniscus.addon.output.ply import read_points, write_points

COLUMNS = {"x": np.array([1.5, -2.0, np.inf], np.float32), "id": np.array([7, -1, 1 << 30], np.int32)}


def test_the_bytes_are_those_of_the_format(tmp_path):
    write_points(tmp_path / "new" / "points.ply", COLUMNS)
    header, _, body = (tmp_path / "new" / "points.ply").read_bytes().partition(b"end_header\n")
    lines = [b"ply", b"format binary_little_endian 1.0", b"element vertex 3", b"property float x", b"property int id"]
    assert header.splitlines() == lines
    assert body == struct.pack("<fifi", 1.5, 7, -2.0, -1) + struct.pack("<fi", np.inf, 1 << 30)


def test_what_was_written_is_read(tmp_path):
    write_points(tmp_path / "points.ply", COLUMNS)
    found = read_points(tmp_path / "points.ply", ("id", "x"))
    assert list(found) == ["id", "x"]
    for name, column in found.items():
        np.testing.assert_array_equal(column, COLUMNS[name])


def test_no_point_is_a_file_too(tmp_path):
    write_points(tmp_path / "points.ply", {name: column[:0] for name, column in COLUMNS.items()})
    assert len(read_points(tmp_path / "points.ply", ("x",))["x"]) == 0


def test_files_of_other_programs_are_read(tmp_path):
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment by hand\nelement vertex 2\nproperty uchar red\nproperty double x\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    body = struct.pack("<BdBd", 255, 0.1, 0, 0.2) + struct.pack("<Biii", 3, 0, 1, 1)
    (tmp_path / "points.ply").write_bytes(header.encode() + body)
    assert read_points(tmp_path / "points.ply", ("x",))["x"].tolist() == [0.1, 0.2]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "no such file"),
        (b"", "not a binary PLY"),
        (b"\xff\xfe rubbish\n", "not a binary PLY"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "not a binary PLY"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex one\nend_header\n", "not a binary PLY"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex -4\nproperty float x\nend_header\n", "not a binary PLY"),
        (b"ply\nformat binary_little_endian 1.0\nelement\nend_header\n", "not a binary PLY"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty long x\nend_header\n12345678", "not a binary PLY"),
        (b"end_header\n", "not a binary PLY"),
        (b"ply\nformat binary_little_endian 1.0\nend_header\n", "not a binary PLY"),
        (b"ply\nformat binary_little_endian 1.0\nelement face 1\nelement vertex 1\nend_header\n", "not a binary PLY"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty list uchar int x\nend_header\n", "not a binary"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float y\nend_header\n1234", "no property 'x'"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nend_header\n1234567", "not whole"),
    ],
)
def test_what_cannot_be_read_is_told(tmp_path, content, reason):
    if content is not None:
        (tmp_path / "points.ply").write_bytes(content)
    with pytest.raises(OutputError, match=reason):
        read_points(tmp_path / "points.ply", ("x",))


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="folder"):
        write_points(tmp_path / "file" / "points.ply", COLUMNS)
