"""A child process that measures on request: what it does to itself, by a crash, a hang or want of memory, ends only it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from .timing import CaseError

Message = dict[str, Any]

KILL_LIMIT = 60.0
"""Seconds that the system may take to end a process and to free its memory."""
TESTS = Path(__file__).resolve().parents[1]


class Worker:
    """The parent's end. The process starts with the first request, and anew with the next one after its end.

    A request is a dictionary of plain data; its entry "do" is what the process is to do, in words.

    Parameters
    ----------
    command
        A Python and what it runs; it calls `serve`. It finds this package on its path.
    log
        Where its output goes.
    variables
        Environment variables besides this process's.
    """

    def __init__(self, command: Sequence[str], log: Path, variables: Mapping[str, str] | None = None) -> None:
        self._command = list(command)
        self._log = log
        self._variables = {**os.environ, "PYTHONPATH": str(TESTS), **(variables or {})}
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *reason: object) -> None:
        self.stop()

    def ask(self, request: Message, limit: float) -> Message:
        """The reply to a request.

        Raises
        ------
        CaseError
            The process took longer than `limit` seconds and was ended, it ended by itself, or it reports an error.
        """
        if self._process is None:
            self._start()
        try:
            self._connection.send(request)
            if not self._connection.poll(limit):
                self.stop()
                raise CaseError(f"took longer than {limit:g} s to {request['do']}")
            reply: Message = self._connection.recv()
        except (EOFError, ConnectionError) as error:
            raise CaseError(self._how_it_ended()) from error
        if "error" in reply:
            raise CaseError(reply["error"])
        return reply

    def stop(self) -> None:
        """End the process, and those that it started."""
        if self._process is not None:
            self._connection.close()
            if self._process.poll() is None:
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait(KILL_LIMIT)
            self._process = None

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        self._log.parent.mkdir(parents=True, exist_ok=True)
        with theirs, self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [*self._command, str(theirs.fileno())],
                env=self._variables,
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self._connection = Connection(ours.detach())

    def _how_it_ended(self) -> str:
        assert self._process is not None
        try:
            status = self._process.wait(10)
        except subprocess.TimeoutExpired:
            self.stop()
            return f"closed its connection, see {self._log}"
        self.stop()
        if status == -signal.SIGKILL:
            return "was killed by the system, as it is when memory runs out"
        if status < 0:
            return f"crashed ({signal.Signals(-status).name}), see {self._log}"
        return f"ended with exit status {status}, see {self._log}"


def serve(handle: Callable[[Message], Message]) -> None:
    """The child's end: answer requests until the parent is gone. The last argument is the connection's file descriptor."""
    _be_the_first_to_go()
    connection = Connection(int(sys.argv[-1]))
    while True:
        try:
            request = connection.recv()
        except (EOFError, ConnectionError):
            return
        connection.send(_reply(handle, request))


def _reply(handle: Callable[[Message], Message], request: Message) -> Message:
    try:
        return handle(request)
    # Whatever it is, the parent reports it and the other cases go on.
    except Exception as error:  # noqa: BLE001
        traceback.print_exc()
        first_line = (str(error).splitlines() or [""])[0]
        return {"error": f"{type(error).__name__}: {first_line}"}


def _be_the_first_to_go() -> None:
    """Where memory runs out, Linux is to end this process before any other."""
    score = Path("/proc/self/oom_score_adj")
    if score.exists():
        score.write_text("1000")
