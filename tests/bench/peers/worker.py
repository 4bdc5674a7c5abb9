"""The child process that runs one peer: python -m bench.peers.worker MODULE."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import numpy as np

from bench.worker import Message, serve

from .peer import Task


class Server:
    """Answers the requests of `run_peers`."""

    def __init__(self, module: str) -> None:
        self._create: Any = importlib.import_module(f"{__package__}.{module}").create
        self._peer: Any

    def handle(self, request: Message) -> Message:
        if request["do"] == "prepare":
            with np.load(request["positions"]) as saved:
                self._peer = self._create(Task(positions=saved["positions"], **request["task"]))
            return {}
        if request["do"] == "make the surface":
            return self._peer.surface()
        if request["do"] == "save its picture":
            self._peer.save_picture(request["path"])
            return {"triangles": None}
        return self._save_mesh(request["path"])

    def _save_mesh(self, path: str) -> Message:
        mesh = self._peer.mesh()
        np.savez(path, vertices=mesh.vertices, normals=mesh.normals, triangles=mesh.triangles)
        return {"triangles": len(mesh.triangles)}


if __name__ == "__main__":
    serve(Server(sys.argv[1]).handle)
