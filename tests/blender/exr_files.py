"""Reads OpenEXR files in a process of its own, because some programs bring an OpenEXR that does not get along with Python's."""

import os
import subprocess
import sys

import numpy as np

_READ = """
import sys
import numpy
import OpenEXR
with OpenEXR.File(sys.argv[1], separate_channels=True) as file:
    numpy.savez(sys.argv[2], **{name: channel.pixels for part in file.parts for name, channel in part.channels.items()})
"""


def exr_channels(path):
    """Each channel (height, width) of all parts by its full name, row 0 at the bottom."""
    arrays = f"{path}.npz"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    subprocess.run([sys.executable, "-c", _READ, path, arrays], check=True, env=environment)
    with np.load(arrays) as saved:
        return {name: pixels[::-1] for name, pixels in saved.items()}
