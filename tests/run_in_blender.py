"""Runs the tests beside this file inside a Blender in which the extension was installed and enabled at an earlier start.

blender --background --python run_in_blender.py -- SITE [PYTEST_ARGUMENT ...]

SITE is a folder that holds pytest. The exit status is pytest's, or 1 where the extension cannot be disabled afterwards.
"""

import sys
import traceback

import addon_utils
import bpy

EXTENSION = "bl_ext.user_default.meniscus"

site, *pytest_arguments = sys.argv[sys.argv.index("--") + 1 :]
if EXTENSION not in bpy.context.preferences.addons:
    sys.exit(f"The extension {EXTENSION} is not enabled at this start of Blender {bpy.app.version_string}.")
sys.path.insert(0, site)

import pytest  # noqa: E402 - found in the folder that was just added

status = int(pytest.main(pytest_arguments))
sys.stdout.flush()

# Blender disables its extensions when it quits, and would only print what goes wrong there.
errors: list[Exception] = []
addon_utils.disable(EXTENSION, handle_error=errors.append)
for error in errors:
    traceback.print_exception(error)
sys.exit(status or len(errors))
