"""Reads OpenEXR files in a process of its own, because some programs bring an OpenEXR that does not get along with Python's."""

import json
import os
import subprocess
import sys

import numpy as np

_READ = """
import json
import sys
import numpy
import OpenEXR
with OpenEXR.File(sys.argv[1], separate_channels=True) as file:
    numpy.savez(sys.argv[2], **{name: channel.pixels for part in file.parts for name, channel in part.channels.items()})
    print(json.dumps({name: value for name, value in file.header().items() if isinstance(value, (str, int, float))}))
"""


def exr_channels(path):
    """Each channel (height, width) of all parts by its full name, row 0 at the bottom."""
    return exr_content(path)[0]


def exr_content(path):
    """Channels as :func:`exr_channels` gives them, and the texts and numbers of the (first) header."""
    arrays = f"{path}.npz"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", _READ, str(path), arrays]
    printed = subprocess.run(command, check=True, env=environment, stdout=subprocess.PIPE).stdout
    with np.load(arrays) as saved:
        return {name: pixels[::-1] for name, pixels in saved.items()}, json.loads(printed)
