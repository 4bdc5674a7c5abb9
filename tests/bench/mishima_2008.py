"""`make bench-mishima`: the experiments of Mishima, Tanaka and Sagawa 2008, the paper's frames a second beside ours."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

import meniscus
from meniscus.addon.render.registry import gpu
from meniscus.gpu_shaders.methods.equal_interval.method import EqualInterval
from meniscus.samples import jets

from . import machine, report
from .scenes import three_quarter_camera

NAME = "mishima-2008"
PAGE = report.ROOT / "docs" / "mishima_2008.md"
IMAGES = report.ROOT / "docs" / "images"
METHOD = "equal_interval"
FIELD = meniscus.Field("mishima", 0.765625)
REACH = 0.61
"""h of the paper, and its threshold above."""
SIDE, SPACING = 24, 0.5
"""Balls along a layer's sides, as the paper says, and between neighbours, which it does not."""
FLOW_RADIUS = 0.22
"""Influence radius of the balls of a fountain that is as sparse as the paper's streams, Blender units."""
PAPER_SETTINGS = {"samples": 32, "adaptive": False, "refinements": 1}
FRAMES = {
    (4096, 128): 60, (4096, 256): 35, (4096, 512): 11,
    (16384, 128): 37, (16384, 256): 21, (16384, 512): 10,
    (65536, 128): 12, (65536, 256): 7, (65536, 512): 3,
}  # fmt: skip
"""Table 1, by balls and pixels a side: frames a second on a GeForce 8800 GTX."""
LIMITS = {16: 36, 32: 25, 52: 18, 64: None, 128: None}
"""Samples of figure 12, and the frames a second that the paper gives for them."""
COLORS = 256


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="make bench-mishima", description="Time Equal Interval on the scenes of its paper.")
    parser.add_argument("--balls", nargs="+", type=int, default=[4096, 16384, 65536], metavar="N", help="of the stacks")
    parser.add_argument("--repeats", type=int, default=3, help="measured frames of a case, of which the best counts")
    parser.add_argument("--pictures", action="store_true", help="render the pictures of docs/mishima_2008.md instead")
    parser.add_argument("--update-docs", action="store_true", help="also put the tables into docs/mishima_2008.md")
    options = parser.parse_args(arguments)
    if options.pictures:
        save_pictures()
        return
    about = machine.describe() | {"gl_renderer": gpu().shared_context().renderer}
    print(about["warning"], flush=True)
    tables = [
        frames_table(options.balls, options.repeats),
        limits_table(options.repeats),
        culling_table(options.balls, options.repeats),
    ]
    text = "\n\n".join([report.machine_text(about), *tables])
    report.publish(NAME, {"machine": about, "text": text}, text, options.update_docs, PAGE)


@cache
def stack(count: int) -> meniscus.Balls:
    """Square layers on one another, the last one not full."""
    number = np.arange(count)
    places = np.stack([number % SIDE, number // SIDE % SIDE, number // SIDE**2], axis=1)
    return meniscus.Balls((places - (SIDE - 1) / 2 * np.array([1, 1, 0])) * SPACING, REACH)


@cache
def flow() -> meniscus.Balls:
    """Streams of water."""
    return meniscus.Balls(jets.balls(4096).positions, FLOW_RADIUS)


def flow_camera(size: int) -> meniscus.Camera:
    return meniscus.Camera.perspective(jets.EYE, jets.TARGET, fov_y=0.48, width=size, height=size)


def render(balls: meniscus.Balls, camera: meniscus.Camera, **settings: Any) -> meniscus.ImageBuffers:
    """The surface alone, as the paper's times are without light."""
    return meniscus.render(balls, camera, FIELD, method=METHOD, passes=("depth", "normal"), settings=settings)


def best(action: Callable[[], object], repeats: int) -> float:
    """Milliseconds of the fastest of several runs, after one that does not count."""
    action()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(1e3 * (time.perf_counter() - start))
    return min(times)


def frames_table(counts: list[int], repeats: int) -> str:
    """Table 1: frames a second by balls and pixels."""
    rows = []
    for (count, size), paper in FRAMES.items():
        if count not in counts:
            continue
        balls = stack(count)
        camera = three_quarter_camera(balls, size, size)
        plain = best(lambda balls=balls, camera=camera: render(balls, camera, **PAPER_SETTINGS), repeats)
        whole = best(lambda balls=balls, camera=camera: render(balls, camera), repeats)
        info = render(balls, camera, **PAPER_SETTINGS).info.counts
        unfinished = 100 * info["unfinished"] / size**2
        rows.append(
            [f"{count:,}", f"{size}x{size}", f"{paper}", f"{1e3 / plain:.1f}", f"{1e3 / whole:.1f}", f"{unfinished:.2f}"]
        )
        print(rows[-1], flush=True)
    headers = ["balls", "size", "paper", "ours, as the paper", "ours, adaptive", "unfinished as the paper, % of pixels"]
    return report.table(headers, rows)


def limits_table(repeats: int) -> str:
    """Figure 12: what the limit leaves out, beside the image that has no holes."""
    rows = []
    for name, balls, camera in (
        ("stack", stack(4096), three_quarter_camera(stack(4096), 512, 512)),
        ("streams", flow(), flow_camera(512)),
    ):
        whole = render(balls, camera)
        for limit, paper in LIMITS.items():
            image = render(balls, camera, **{**PAPER_SETTINGS, "samples": limit})
            holes = np.count_nonzero(whole.hit & ~image.hit)
            spent = best(lambda limit=limit, balls=balls, camera=camera: _limited(balls, camera, limit), repeats)
            unfinished = image.info.counts["unfinished"]
            rows.append([name, f"{limit}", f"{paper or ''}", f"{1e3 / spent:.1f}", f"{unfinished}", f"{holes}"])
            print(rows[-1], flush=True)
        spent = best(lambda balls=balls, camera=camera: render(balls, camera), repeats)
        rows.append([name, "adaptive", "", f"{1e3 / spent:.1f}", f"{whole.info.counts['unfinished']}", "0"])
        print(rows[-1], flush=True)
    return report.table(["scene", "samples", "paper", "ours", "unfinished pixels", "pixels that miss the fluid"], rows)


def _limited(balls: meniscus.Balls, camera: meniscus.Camera, limit: int) -> meniscus.ImageBuffers:
    return render(balls, camera, **{**PAPER_SETTINGS, "samples": limit})


def culling_table(counts: list[int], repeats: int) -> str:
    """Section 4.3: with and without leaving out balls that reach no sample of the pixels around them."""
    context = gpu().shared_context()
    rows = []
    for count in counts:
        balls = stack(count)
        camera = three_quarter_camera(balls, 256, 256)
        times = []
        for ball_culling in (True, False):
            context._kept[EqualInterval] = EqualInterval(context, ball_culling)
            times.append(best(lambda balls=balls, camera=camera: render(balls, camera, **PAPER_SETTINGS), repeats))
        del context._kept[EqualInterval]
        with_culling, without = times
        rows.append([f"{count:,}", f"{with_culling:.0f}", f"{without:.0f}", f"{without / with_culling:.2f}"])
        print(rows[-1], flush=True)
    return report.table(["balls", "with culling, ms", "without, ms", "times as fast"], rows)


def save_pictures() -> None:
    """Render the pictures into docs/images: figure 9, of the stacks; 8, of the interpolation; and 12, of holes."""
    for count in (4096, 16384, 65536):
        balls = stack(count)
        save(f"figure_9_{count}", shaded(render(balls, three_quarter_camera(balls, 256, 256))))
    balls, camera = stack(4096), close_camera(256)
    for name, refinements in (("samples", 0), ("secant", 1)):
        settings = {**PAPER_SETTINGS, "samples": 256, "refinements": refinements}
        save(f"figure_8_{name}", as_colors(render(balls, camera, **settings)))
    balls, camera = flow(), flow_camera(512)
    for limit in (16, 32, 52):
        save(f"figure_12_{limit}", shaded(_limited(balls, camera, limit), smaller=2))
    save("figure_12_adaptive", shaded(render(balls, camera), smaller=2))


def close_camera(size: int) -> meniscus.Camera:
    return meniscus.Camera.perspective((4.6, -9.0, 6.2), (2.6, -4.2, 3.0), fov_y=0.4, width=size, height=size)


def shaded(image: meniscus.ImageBuffers, smaller: int = 1) -> npt.NDArray[np.float64]:
    """Light from the eye's left and above; white where there is nothing."""
    light = np.array([-0.4, -0.6, 0.7]) / np.linalg.norm([-0.4, -0.6, 0.7])
    bright = 0.25 + 0.75 * np.maximum(image["normal"] @ light, 0)
    colors = np.where(image.hit[..., None], bright[..., None] * np.array([0.25, 0.55, 0.9]), 1.0)
    height, width = image.hit.shape
    return colors.reshape(height // smaller, smaller, width // smaller, smaller, 3).mean(axis=(1, 3))


def as_colors(image: meniscus.ImageBuffers) -> npt.NDArray[np.float64]:
    """The directions of normals as colours."""
    return np.where(image.hit[..., None], 0.5 + 0.5 * image["normal"].astype(np.float64), 1.0)


def save(name: str, linear: npt.NDArray[np.float64]) -> None:
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    path = IMAGES / f"mishima_2008_{name}.png"
    picture = Image.fromarray(np.rint(255 * np.clip(encoded[::-1], 0, 1)).astype(np.uint8))
    picture.quantize(COLORS, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path} {path.stat().st_size / 1024:.0f} KiB", flush=True)


if __name__ == "__main__":
    main()
