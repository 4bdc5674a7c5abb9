"""The native module that came with the extension is the one that Blender's Python finds."""

from pathlib import Path

import bpy
import meniscus_native
from blender_fixtures import runs_inside_program


def test_native_module_is_the_extensions(meniscus):
    assert meniscus_native.__version__ == meniscus.__version__
    if runs_inside_program():
        assert Path(bpy.utils.user_resource("EXTENSIONS")) in Path(meniscus_native.__file__).parents
