"""Runs the tests beside this file inside a Blender in which the extension was installed and enabled at an earlier start.

blender [--background] --python run_in_blender.py -- SITES [PYTEST_ARGUMENT ...]

SITES has a folder with pytest for each version of Python. With a window, pytest runs in Blender's event loop (event_loop.py),
and Blender quits as users quit it if all is well. The exit status is pytest's, or 1 where Blender hangs, or where the
extension cannot be disabled afterwards.
"""

import faulthandler
import sys
import traceback
from pathlib import Path

import addon_utils
import bpy

EXTENSION = "bl_ext.user_default.meniscus"
LONGEST_RUN = 900
"""Seconds after which Blender surely hangs."""

sites, *pytest_arguments = sys.argv[sys.argv.index("--") + 1 :]
site = Path(sites, "{}.{}".format(*sys.version_info))
if not site.is_dir():
    sys.exit(f"There is no pytest for Python {site.name}, which is in this Blender: add it in tools/hosts.py.")
if EXTENSION not in bpy.context.preferences.addons:
    sys.exit(f"The extension {EXTENSION} is not enabled at this start of Blender {bpy.app.version_string}.")
sys.path[:0] = [str(site), str(Path(__file__).parent)]

import event_loop  # noqa: E402 - needs greenlet, in the folder that was just added
import pytest  # noqa: E402


def run_pytest() -> int:
    status = int(pytest.main(pytest_arguments))
    sys.stdout.flush()
    return status


def run_in_window() -> None:
    status = run_pytest()
    if status:
        event_loop.leave(status)
    bpy.ops.wm.quit_blender()


def run_without_window() -> None:
    status = run_pytest()
    # Blender disables its extensions when it quits, and would only print what goes wrong there.
    errors: list[Exception] = []
    addon_utils.disable(EXTENSION, handle_error=errors.append)
    for error in errors:
        traceback.print_exception(error)
    sys.exit(status or len(errors))


faulthandler.dump_traceback_later(LONGEST_RUN, exit=True)
if bpy.app.background:
    run_without_window()
else:
    event_loop.start(run_in_window)
