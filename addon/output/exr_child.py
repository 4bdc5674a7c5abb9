"""What runs in the child process of :mod:`exr_process`: takes file contents from a pipe and writes them.

A request is one line of JSON (path and, by part, attributes and, by array, name, type and shape), then the arrays' bytes in
the same order. The answer is one line of JSON: the error's kind and sentence, empty where all went well.
"""

from __future__ import annotations

import json
import math
import os
import signal
import sys
from collections.abc import Iterator
from io import BufferedReader, BufferedWriter
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from ..fluid.errors import FullDiskError, MeniscusError, OutputError
from .exr import EncodingMemory, write_content
from .exr_content import Channel, ExrContent, ExrPart

_NICENESS = 10
"""The next frame goes before files; it has to wait for them only where :data:`exr_process.MAX_IN_FLIGHT` are under way."""


def send_request(stream: IO[bytes], path: str, content: ExrContent) -> None:
    """The parent's side: ask for `content` to be written to `path`."""
    parts = [
        {
            "attributes": part.attributes,
            "arrays": [[name, channel.dtype.name, channel.values.shape] for name, channel in _arrays(part)],
        }
        for part in content.parts
    ]
    stream.write(json.dumps({"path": path, "parts": parts}).encode() + b"\n")
    for part in content.parts:
        for _, channel in _arrays(part):
            stream.write(channel.pixels().data)
    stream.flush()


def _arrays(part: ExrPart) -> list[tuple[str | None, Channel]]:
    """The channels by name, and under no name the counts of a deep part."""
    counts = [] if part.counts is None else [(None, Channel(part.counts))]
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
    if hasattr(os, "nice"):  # On Windows the parent starts it with a low priority.
        os.nice(_NICENESS)
    # Ctrl-C reaches the whole process group, but the parent decides when to stop: a file that was begun is finished.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # An exit by exception, so that a temporary file is removed.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    requests = _Requests(os.fdopen(sys.stdin.fileno(), "rb", closefd=False))
    memory = EncodingMemory()
    with _private_stdout() as answers:
        for path, content in requests:
            answers.write(json.dumps(_answer(path, content, memory)).encode() + b"\n")
            answers.flush()


def _private_stdout() -> BufferedWriter:
    """The pipe to the parent; what a library prints goes to the standard error instead."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return answers


def _answer(path: str, content: ExrContent, memory: EncodingMemory) -> tuple[str, str]:
    try:
        write_content(path, content, memory)
    except MeniscusError as error:
        return type(error).__name__, str(error)
    return "", ""


class _Requests:
    """What the parent asks for, one path and content after the other; each lies where the one before it lay.

    The system takes longer to give fresh memory than a pipe takes to fill what is there.
    """

    def __init__(self, stream: BufferedReader) -> None:
        self._stream = stream
        self._memory: npt.NDArray[np.uint8] = np.empty(0, np.uint8)

    def __iter__(self) -> Iterator[tuple[str, ExrContent]]:
        while line := self._stream.readline():
            head = json.loads(line)
            yield head["path"], ExrContent(tuple(self._parts(head["parts"])))

    def _parts(self, heads: list[dict[str, Any]]) -> Iterator[ExrPart]:
        room = sum(_room(dtype, shape) for head in heads for _, dtype, shape in head["arrays"])
        if self._memory.nbytes < room:
            self._memory = np.empty(room, np.uint8)
        free = self._memory
        for head in heads:
            arrays = {}
            for name, dtype, shape in head["arrays"]:
                arrays[name] = self._read(free[: _bytes(dtype, shape)].view(dtype).reshape(shape))
                free = free[_room(dtype, shape) :]
            counts = arrays.pop(None, None)
            yield ExrPart(head["attributes"], {name: Channel(values) for name, values in arrays.items()}, counts)

    def _read(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        if values.nbytes and self._stream.readinto(values.data.cast("B")) != values.nbytes:
            sys.exit("Meniscus ended in the middle of an image, which was not written")
        return values


def _bytes(dtype: str, shape: list[int]) -> int:
    return np.dtype(dtype).itemsize * math.prod(shape)


def _room(dtype: str, shape: list[int]) -> int:
    """Bytes to the next array, which begins where any type may."""
    return -(-_bytes(dtype, shape) // 64) * 64
