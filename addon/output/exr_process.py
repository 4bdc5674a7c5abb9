"""Writes EXR files in a child process.

That overlaps writing with rendering, and it is safe in Blender builds whose own OpenEXR clashes with the OpenEXR package.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import IO, cast

from ..fluid.errors import OutputError
from .exr_child import read_answer, send_request
from .exr_content import ExrContent
from .whole_file import temporary_path

MAX_IN_FLIGHT = 2
"""Images that may be under way at a time; :meth:`ExrProcess.write` waits before it takes a third, to bound the memory."""

_PACKAGE = Path(__file__).resolve().parents[2]

# The package is loaded from its folder: the name that it has in Blender has parents that exist only there.
_BOOTSTRAP = """
import importlib.util, sys
package, *packages = sys.argv[1:]
sys.path += packages
spec = importlib.util.spec_from_file_location("meniscus", package + "/__init__.py", submodule_search_locations=[package])
sys.modules["meniscus"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(sys.modules["meniscus"])
from meniscus.addon.output.exr_child import serve
serve()
"""


class ExrProcess:
    """A child process that writes EXR files, one after the other.

    It starts again where it was killed. Use it in a ``with`` block: leaving it waits for all files.
    """

    def __init__(self) -> None:
        """Costs nothing yet: the process starts with the first file."""
        self._child: _Child | None = None
        self._worker = ThreadPoolExecutor(1, "meniscus_exr", initializer=_block_broken_pipe_signal)
        self._free_places = threading.Semaphore(MAX_IN_FLIGHT)

    def __enter__(self) -> ExrProcess:
        """For ``with`` blocks."""
        return self

    def __exit__(self, *_: object) -> None:
        """Wait for all files."""
        self.close()

    def write(self, path: str | os.PathLike[str], content: ExrContent) -> Future[float]:
        """Begin to write a file, see :func:`exr.write_content`; its arrays must stay as they are until that is done.

        Returns
        -------
        A future that is done when the file is whole: the milliseconds that this took, or the :class:`OutputError` that says
        why it failed.
        """
        self._free_places.acquire()
        future = self._worker.submit(self._write, Path(path).absolute(), content)
        future.add_done_callback(lambda _: self._free_places.release())
        return future

    def close(self) -> None:
        """Wait for all files, then end the process."""
        self._worker.shutdown(wait=True)
        if self._child is not None:
            self._child.end()
            self._child = None

    def _write(self, path: Path, content: ExrContent) -> float:
        """Runs in the worker thread, which alone talks to the child."""
        start = time.perf_counter()
        child = self._child = self._child or _Child()
        if not child.write(path, content):
            self._child = None
            raise child.lost(path)
        return (time.perf_counter() - start) * 1e3


class _Child:
    """One running process."""

    def __init__(self) -> None:
        command = [_python(), "-I", "-c", _BOOTSTRAP, str(_PACKAGE), *_package_folders("numpy", "OpenEXR")]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                creationflags=_creation_flags("CREATE_NO_WINDOW", "BELOW_NORMAL_PRIORITY_CLASS"),
            )
        except OSError as error:
            raise OutputError(f"The process that writes EXR files cannot be started: {error}") from error
        self._requests = cast(IO[bytes], self._process.stdin)
        _widen(self._requests)
        self._answers = cast(IO[bytes], self._process.stdout)

    def write(self, path: Path, content: ExrContent) -> bool:
        """Write a file; False if the process has ended. OutputError says what it could not do."""
        try:
            send_request(self._requests, str(path), content)
            return read_answer(self._answers)
        except OSError:
            return False

    def lost(self, path: Path) -> OutputError:
        """Clear up after the process ended while it had `path` to write, and say so."""
        status = self.end()
        temporary_path(path, self._process.pid).unlink(missing_ok=True)
        return OutputError(
            f"Cannot write {path}: the process that writes EXR files ended early (status {status}); render it again"
        )

    def end(self) -> int:
        """Close the pipes and wait for the exit status."""
        with contextlib.suppress(OSError):  # A pipe to a dead process cannot be flushed.
            self._requests.close()
        self._answers.close()
        return self._process.wait()


def _creation_flags(*names: str) -> int:
    """Those of Windows; 0 elsewhere."""
    return sum(getattr(subprocess, name, 0) for name in names)


def _widen(pipe: IO[bytes]) -> None:
    """Linux gives pipes 64 KB: two processes then take turns thousands of times for an image, a third of what sending takes."""
    if sys.platform == "linux":
        import fcntl

        with contextlib.suppress(OSError):  # The user may have used up what pipes may have.
            fcntl.fcntl(pipe.fileno(), fcntl.F_SETPIPE_SZ, 2**20)


def _block_broken_pipe_signal() -> None:
    """Some builds of Blender do not ignore this signal: they would end with the child. The write then fails with an error."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})


def _python() -> str:
    """The Python to start; in some builds of Blender `sys.executable` is Blender itself or empty."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    prefix = Path(sys.prefix)
    candidates = [Path(sys.executable)] if Path(sys.executable).stem.lower().startswith("python") else []
    candidates += [prefix / "bin" / name for name in (f"python{version}", "python3", "python.exe")]
    candidates += [prefix / "python.exe"]
    for candidate in candidates:
        if os.access(candidate, os.X_OK) and candidate.is_file():
            return str(candidate)
    raise OutputError(
        f"No Python program was found in {prefix} to write EXR files with; use a complete installation of Blender"
    )


def _package_folders(*names: str) -> list[str]:
    """Where the child finds the packages; they are looked up, not imported."""
    specs = [importlib.util.find_spec(name) for name in names]
    origins = [Path(spec.origin) for spec in specs if spec is not None and spec.origin is not None]
    return [str(origin.parent.parent if origin.stem == "__init__" else origin.parent) for origin in origins]
