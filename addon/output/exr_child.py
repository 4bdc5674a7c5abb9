"""What runs in the child process of :mod:`exr_process`: takes file contents from a pipe and writes them.

A request is one line of JSON (path and, by part, attributes and, by array, name, type and shape), then the arrays' bytes in
the same order. The answer is one line of JSON: the error's kind and sentence, empty where all went well.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from io import BufferedReader, BufferedWriter
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from ..fluid.errors import FullDiskError, MeniscusError, OutputError
from .exr import write_content
from .exr_content import ExrContent, ExrPart


def send_request(stream: IO[bytes], path: str, content: ExrContent) -> None:
    """The parent's side: ask for `content` to be written to `path`."""
    parts = [
        {"attributes": part.attributes, "arrays": [[name, values.dtype.name, values.shape] for name, values in _arrays(part)]}
        for part in content.parts
    ]
    stream.write(json.dumps({"path": path, "parts": parts}).encode() + b"\n")
    for part in content.parts:
        for _, values in _arrays(part):
            stream.write(values.data)
    stream.flush()


def _arrays(part: ExrPart) -> list[tuple[str | None, npt.NDArray[Any]]]:
    """The channels by name, and under no name the counts of a deep part."""
    counts = [] if part.counts is None else [(None, part.counts)]
    return [*part.channels.items(), *counts]


def read_answer(stream: IO[bytes]) -> bool:
    """The parent's side: wait until the file is whole; False if the child has ended instead.

    Raises
    ------
    OutputError
        What the child could not do.
    """
    line = stream.readline()
    if not line.endswith(b"\n"):
        return False
    kind, sentence = json.loads(line)
    if kind:
        raise (FullDiskError if kind == FullDiskError.__name__ else OutputError)(sentence)
    return True


def serve() -> None:
    """The child's side: answer requests until the parent closes the pipe."""
    # Ctrl-C reaches the whole process group, but the parent decides when to stop: a file that was begun is finished.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # An exit by exception, so that a temporary file is removed.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    requests = os.fdopen(sys.stdin.fileno(), "rb", closefd=False)
    with _private_stdout() as answers:
        while head := requests.readline():
            answers.write(json.dumps(_answer(requests, head)).encode() + b"\n")
            answers.flush()


def _private_stdout() -> BufferedWriter:
    """The pipe to the parent; what a library prints goes to the standard error instead."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return answers


def _answer(requests: BufferedReader, head_line: bytes) -> tuple[str, str]:
    head = json.loads(head_line)
    parts = [_read_part(requests, part) for part in head["parts"]]
    try:
        write_content(head["path"], ExrContent(tuple(parts)))
    except MeniscusError as error:
        return type(error).__name__, str(error)
    return "", ""


def _read_part(requests: BufferedReader, head: dict[str, Any]) -> ExrPart:
    arrays = {name: _read_array(requests, dtype, shape) for name, dtype, shape in head["arrays"]}
    counts = arrays.pop(None, None)
    return ExrPart(head["attributes"], arrays, counts)


def _read_array(stream: BufferedReader, dtype: str, shape: list[int]) -> npt.NDArray[Any]:
    values = np.empty(shape, dtype)
    if values.nbytes and stream.readinto(values.data.cast("B")) != values.nbytes:
        sys.exit("Meniscus ended in the middle of an image, which was not written")
    return values
