"""The tools that build and test the native core: what goes wrong there must be noticed."""

import zipfile
from pathlib import Path

import native_tests
import native_wheels
import pytest
import rust
import wheel_check
from project import ToolError

LINUX = native_wheels.TARGETS["linux-x64"]


def program(folder: Path, name: str, script: str) -> None:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(f"#!/bin/sh\n{script}\n")
    (folder / name).chmod(0o755)


@pytest.mark.parametrize(
    ("rustc", "cargo", "serves"),
    [
        ("echo 'rustc 1.89.0 (x)'", "echo 'cargo 1.89.0'", True),
        ("echo 'rustc 2.0.0 (x)'", "echo 'cargo 2.0.0'", True),
        ("echo 'rustc 1.63.0 (x)'", "echo 'cargo 1.63.0'", False),
        # rustup's stand-ins without a toolchain.
        ("echo 'no toolchain' >&2; exit 1", "exit 1", False),
        ("echo 'rustc 1.95.0 (x)'", "exit 1", False),
    ],
)
def test_an_old_or_broken_rust_is_passed_over(tmp_path, rustc, cargo, serves):
    program(tmp_path, "rustc", rustc)
    program(tmp_path, "cargo", cargo)
    assert rust.is_recent({"PATH": f"{tmp_path}:/bin:/usr/bin"}) is serves


def test_a_machine_without_rust_gets_the_pinned_one(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setattr(rust, "ensure_compilers", lambda: None)
    monkeypatch.setattr(rust, "fetched", lambda toolchain, target=None: {"fetched": f"{toolchain.name} {target}"})
    assert rust.stable("aarch64-apple-darwin") == {"fetched": "1.95.0 aarch64-apple-darwin"}
    assert rust.nightly() == {"fetched": "nightly-2026-05-20 None"}


def test_a_rust_that_cannot_be_fetched_is_said_in_one_sentence(tmp_path):
    program(tmp_path, "rustup", "echo 'no network' >&2; exit 1")
    with pytest.raises(ToolError, match=r"install it yourself \(Rust 1\.\d+ or later with the target x86_64-pc-windows-gnu\)"):
        rust.fetch(tmp_path / "rustup", rust.STABLE, "x86_64-pc-windows-gnu", {"PATH": "/bin:/usr/bin"})


def test_the_pinned_rust_serves():
    pinned = tuple(int(number) for number in rust.STABLE.name.split("."))
    assert pinned >= tuple(int(number) for number in rust.required_version().split("."))


def test_counts_are_added_up_over_test_programs():
    lines = [
        "running 2 tests\n",
        "test result: ok. 2 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 0.00s\n",
        "test result: FAILED. 1 passed; 4 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s\n",
    ]
    assert native_tests.count(lines, 101) == native_tests.Outcome(101, 3, 4, 1)
    assert native_tests.count([], 0) == native_tests.Outcome(0)


def test_modules_with_unsafe_are_found():
    modules = native_tests.unsafe_modules()
    assert "simd::" in modules
    assert "kernel::" not in modules


def test_a_change_of_the_sources_asks_for_new_wheels(tmp_path, monkeypatch):
    source = tmp_path / "native" / "core.rs"
    source.parent.mkdir()
    source.write_text("one")
    monkeypatch.setattr(rust, "NATIVE", source.parent)
    monkeypatch.setattr(native_wheels, "ROOT", tmp_path)
    before = native_wheels.sources_fingerprint()
    (source.parent / "target").mkdir()
    (source.parent / "target" / "built").touch()
    assert native_wheels.sources_fingerprint() == before
    source.write_text("two")
    assert native_wheels.sources_fingerprint() != before


@pytest.fixture
def wheel() -> Path:
    return native_wheels.build(native_wheels.own_platform())


def test_this_machines_wheel_would_load(wheel):
    wheel_check.check(wheel, LINUX.libraries)


def test_a_wheel_with_a_foreign_library_is_refused(wheel):
    with pytest.raises(ToolError, match=r"needs libc\.so\.6"):
        wheel_check.check(wheel, [name for name in LINUX.libraries if name != "libc.so.6"])


@pytest.mark.parametrize("content", [b"", b"no library", Path("/bin/sh").read_bytes()])
def test_a_wheel_without_a_python_module_is_refused(tmp_path, content):
    path = tmp_path / "empty.whl"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("meniscus_native/meniscus_native.abi3.so", content)
    with pytest.raises(ToolError, match="exports PyInit_meniscus_native"):
        wheel_check.check(path, ["*"])
