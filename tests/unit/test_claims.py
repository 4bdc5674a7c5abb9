"""Placeholders of frames that are being rendered."""

import resource

from meniscus.addon.output.claims import claim, give_up, is_taken


def test_a_file_is_claimed_once_and_given_up(tmp_path):
    path = tmp_path / "shots" / "0001.exr"
    assert claim(path)
    assert is_taken(path)
    assert not claim(path)
    give_up(path)
    assert not path.exists()


def test_a_whole_file_is_never_given_up(tmp_path):
    (tmp_path / "0001.exr").write_bytes(b"whole")
    give_up(tmp_path / "0001.exr")
    assert (tmp_path / "0001.exr").read_bytes() == b"whole"


def test_an_empty_file_counts_for_nothing(tmp_path):
    (tmp_path / "0001.exr").touch()
    assert not is_taken(tmp_path / "0001.exr")


def test_a_full_disk_leaves_no_half_claim_that_looks_like_a_file(tmp_path):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    # A limit on the size of files makes the system refuse the write in the middle, as a full disk does.
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, hard))
    try:
        assert claim(tmp_path / "0001.exr")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []
