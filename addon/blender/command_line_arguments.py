"""What can be said on the command line. Imports no bpy."""

from __future__ import annotations

import argparse
import re
from typing import NoReturn

from ..fluid.displays import DISPLAYS
from ..fluid.errors import InputError
from ..fluid.passes import PASSES, checked_passes
from ..output.exr_content import COMPRESSIONS, LAYOUTS

_EXAMPLE = """
example:
  blender -b scene.blend --command meniscus render --frames 1:10 --output //passes/fluid_####.exr
"""


_TRACED = {
    "reflections": "how many mirrors light may meet",
    "refractions": "how many surfaces light may pass",
    "occlusion-rays": "how many rays ask how much of the world a point sees, 0 for none",
    "light-samples": "how often light is traced for each sample",
}

_LAST_FRAME = 1048574
"""Blender's own limit."""

_LARGEST_SIDE = 65536
"""Pixels; Blender's own limit."""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence, without the usage in front of it."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"meniscus: {message}; --help lists the options\n")


def parse_arguments(arguments: list[str]) -> argparse.Namespace:
    """What follows ``--command meniscus``.

    Raises
    ------
    SystemExit
        With status 0 after ``--help``, with status 2 after a sentence on the standard error.
    """
    parser = _Parser(
        prog="blender -b SCENE.blend --command meniscus",
        description="Ray-casts particle fluids without the user interface.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_render(commands)
    return parser.parse_args(arguments)


def _add_render(commands: argparse._SubParsersAction[_Parser]) -> None:
    render = commands.add_parser(
        "render",
        help="render frames to multilayer OpenEXR files",
        description="Render frames to multilayer OpenEXR files. The exit status is 0 only if every file was written.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    render.add_argument(
        "--frames",
        type=frame_numbers,
        metavar="LIST",
        help="N, FIRST:LAST or FIRST:LAST:STEP, several with commas between; write --frames=-5:5 for negative ones; "
        "the scene's frame range if left out",
    )
    render.add_argument(
        "--output",
        required=True,
        metavar="FILE",
        help="where to write; // is the folder of the .blend file, #### the frame number and {pass} the name of a pass; the "
        "tokens of Blender's own paths, such as {blend_name}, {scene_name}, {camera_name} and {fps:##}, are replaced",
    )
    render.add_argument("--camera", metavar="NAME", help="a camera object; the scene's camera if left out")
    render.add_argument(
        "--resolution", type=resolution, metavar="WxH", help="size in pixels; the scene's, with its percentage, if left out"
    )
    render.add_argument(
        "--passes",
        type=pass_names,
        default=("depth", "normal"),
        metavar="LIST",
        help=f"of {', '.join(PASSES)}, with commas between; depth,normal if left out",
    )
    render.add_argument(
        "--samples", type=sample_count, metavar="N", help="of Combined and Alpha, for antialiasing; the scene's if left out"
    )
    render.add_argument(
        "--ray-tracing",
        action=argparse.BooleanOptionalAction,
        help="follow light beyond the first surface in Combined; the scene's choice if left out",
    )
    for name, what in _TRACED.items():
        render.add_argument(
            f"--{name}", type=whole_number, metavar="N", help=f"{what}, with ray tracing; the scene's number if left out"
        )
    render.add_argument(
        "--display", choices=tuple(DISPLAYS), help="what the balls are shown as; the scene's choice if left out"
    )
    render.add_argument("--method", metavar="NAME", help="how the surface is found; the scene's choice if left out")
    render.add_argument(
        "--setting",
        action="append",
        type=named_value,
        default=[],
        metavar="NAME=VALUE",
        help="of the method, may be given several times; the scene's settings of the method if left out",
    )
    render.add_argument("--backend", metavar="NAME", help="auto, gpu or cpu; the scene's choice if left out")
    render.add_argument("--compression", choices=COMPRESSIONS, default="ZIP", help="all lossless; ZIP if left out")
    render.add_argument(
        "--layout",
        choices=[name.lower() for name in LAYOUTS],
        default="multilayer",
        help="all passes in one part of a file, each in a part of its own, or in a file of its own; multilayer if left out",
    )
    render.add_argument("--deep", action="store_true", help="write a deep file beside each frame's others, NAME_deep")
    render.add_argument(
        "--overwrite",
        action=argparse.BooleanOptionalAction,
        help="write files again that are there, or leave their frames out; the scene's choice if left out",
    )
    render.add_argument(
        "--placeholders",
        action=argparse.BooleanOptionalAction,
        help="claim each frame before it is rendered, so that several processes can share a range (with --no-overwrite); "
        "the scene's choice if left out",
    )
    render.add_argument("--view-layer", metavar="NAME", help="the view layer to render; the first one if left out")
    render.add_argument("--preview", action="store_true", help="write a PNG picture beside each file")
    render.add_argument(
        "--json", metavar="FILE", help="write a report; - prints it as one line and sends the progress to the standard error"
    )


def frame_numbers(text: str) -> tuple[int, ...]:
    """The frames that `text` lists (``3``, ``1:10``, ``1:10:2``, ``1,5,20:30``), in its order and each once."""
    return tuple(dict.fromkeys(frame for part in text.split(",") for frame in _frame_range(part)))


def _frame_range(text: str) -> range:
    match = re.fullmatch(r"\s*(-?\d+)(?::(-?\d+)(?::(\d+))?)?\s*", text)
    if not match:
        raise argparse.ArgumentTypeError(f"'{text}' is no frame range; write N, FIRST:LAST or FIRST:LAST:STEP")
    first, last, step = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
    if max(abs(first), abs(last)) > _LAST_FRAME:
        raise argparse.ArgumentTypeError(f"the frames of '{text}' lie beyond Blender's last frame, {_LAST_FRAME}")
    if last < first:
        raise argparse.ArgumentTypeError(f"the range '{text}' runs backwards; write {last}:{first}")
    if step == 0:
        raise argparse.ArgumentTypeError(f"the step of '{text}' must be at least 1")
    return range(first, last + 1, step)


def resolution(text: str) -> tuple[int, int]:
    """Width and height from ``640x480``."""
    match = re.fullmatch(r"(\d+)x(\d+)", text.lower())
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not all(1 <= pixels <= _LARGEST_SIDE for pixels in size):
        raise argparse.ArgumentTypeError(f"'{text}' is no image size; write WIDTHxHEIGHT, each from 1 to {_LARGEST_SIDE}")
    return size


def sample_count(text: str) -> int:
    """A number of samples, 1 or more."""
    if not re.fullmatch(r"\d+", text) or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is no number of samples; write 1 or more")
    return int(text)


def whole_number(text: str) -> int:
    """A number, 0 or more."""
    if not re.fullmatch(r"\d+", text):
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number; write 0 or more")
    return int(text)


def named_value(text: str) -> tuple[str, str]:
    """Name and value from ``name=value``."""
    name, sign, value = text.partition("=")
    if not (name.strip() and sign and value.strip()):
        raise argparse.ArgumentTypeError(f"'{text}' is no setting; write NAME=VALUE")
    return name.strip(), value.strip()


def pass_names(text: str) -> tuple[str, ...]:
    """Names of passes from ``depth,normal``."""
    try:
        return checked_passes(name.strip() for name in text.split(","))
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
