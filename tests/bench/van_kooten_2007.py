"""`make bench-van-kooten`: the experiments of van Kooten, van den Bergen and Telea 2007, and a fountain in time."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

import meniscus
from meniscus.addon.render.particle_follower import ParticleFollower
from meniscus.addon.render.surface_particles import ParticleCloud
from meniscus.gpu_shaders.context import shared_context
from meniscus.gpu_shaders.methods.surface_particles.crowds import Crowd, GridCrowd, ImageCrowd, Reaches
from meniscus.gpu_shaders.methods.surface_particles.state import ParticleState, Pressures

from . import machine, report
from .scenes import SCENES
from .timing import ALL, Plan, interleave, statistics_by_stage, timed
from .van_kooten_scenes import FIELD, GLASS_REACH, GLASS_SPACING, cylinder, cylinder_start, fountain, glass

FloatArray = npt.NDArray[np.float64]

NAME = "van-kooten-2007"
PAGE = report.ROOT / "docs" / "van_kooten_2007.md"
IMAGES = report.ROOT / "docs" / "images"
COUNT = 16384
"""Surface particles, as in the paper."""
FRAME_RATE = 60
FIGURE_9_SECONDS, FIGURE_9_COUNT = 3, 2048
PROBES = 2000
"""Points of the surface at which it is asked whether a particle is near."""
QUERY_SIZES = (1.1, 1.6, 2.2, 3.0, 4.0)
"""How far neighbours are looked for, in distances between neighbours of an even spread."""
FOUNTAIN_FRAMES, FOUNTAIN_EVERY = 100, 20
FOUNTAIN_STEPS = 10
COUNTS = (0, COUNT, 131_072, 1_000_000)
COUNT_FRAMES = 3
COLORS = 128
INK, GRID, LINES = "#202020", "#dddddd", {"repulsion": "#c8261e", "repulsion and dispersion": "#2f6cb0"}
PLOT_SIZE, FINER = (640, 320), 3


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="make bench-van-kooten", description="Repeat the experiments of a paper.")
    parser.add_argument("--repeats", type=int, default=7, help="measured rounds of a case")
    parser.add_argument("--pictures", action="store_true", help="render the pictures of docs/van_kooten_2007.md instead")
    parser.add_argument("--update-docs", action="store_true", help="also put the tables into docs/van_kooten_2007.md")
    options = parser.parse_args(arguments)
    if options.pictures:
        save_figure_9()
        save_figure_11()
        return
    about = machine.describe() | {"gl_renderer": shared_context().renderer}
    print(about["warning"], flush=True)
    text = "\n\n".join([report.machine_text(about), query_table(Plan(options.repeats)), fountain_table(), count_table()])
    report.publish(NAME, {"machine": about, "text": text}, text, options.update_docs, PAGE)


def query_table(plan: Plan) -> str:
    """How often a second neighbours are found in a glass of water, by how far they are looked for (figure 10)."""
    context, cloud = shared_context(), seeded(glass(), COUNT).cloud
    state = context.run(lambda: ParticleState.of(context, cloud))
    pressures = context.run(lambda: Pressures(context, state.count))
    spacing = float(np.median(cloud.spacings)) / (GLASS_REACH * GLASS_SPACING)
    kinds = [kind for kind in (ImageCrowd, GridCrowd) if kind is ImageCrowd or context.version >= 430]
    crowds: dict[str, Crowd] = {kind.__name__: context.run(partial(kind, context)) for kind in kinds}

    def search(crowd: Crowd, size: float) -> Callable[[], object]:
        reaches = Reaches(size * spacing, (GLASS_REACH * GLASS_SPACING,) * 2)

        def once() -> object:
            crowd.press(state, reaches, 1, pressures)
            return pressures.read_company()

        return lambda: context.run(once)

    cases = {(name, size): timed(search(crowd, size)) for name, crowd in crowds.items() for size in QUERY_SIZES}
    outcomes = interleave(cases, plan)
    labels = {"ImageCrowd": "image, two passes", "GridCrowd": "grid, compute shaders"}
    rows = []
    for name in crowds:
        medians = [statistics_by_stage(outcomes[name, size])[ALL].median for size in QUERY_SIZES]
        rows.append([labels[name], *(f"{1e3 / median:.1f}" for median in medians)])
        print(rows[-1], flush=True)
    return report.table(["searches a second by reach", *(f"{size:g}" for size in QUERY_SIZES)], rows)


def fountain_table() -> str:
    """How well the particles stay on a fountain."""
    follower = ParticleFollower(meniscus.SurfaceParticles(steps=FOUNTAIN_STEPS))
    rows, milliseconds = [], []
    for frame in range(1, FOUNTAIN_FRAMES + 1):
        seconds = 1.0 + frame / 24
        balls = fountain(seconds)
        start = time.perf_counter()
        happened = follower.go_to(balls, FIELD, seconds)
        milliseconds.append(1e3 * (time.perf_counter() - start))
        if frame % FOUNTAIN_EVERY == 0:
            cloud = follower.particles.cloud
            numbers = [f"{distance_rms(cloud, balls):.1e}", f"{variation(cloud):.2f}", f"{covered(balls, cloud):.2%}"]
            counts = [len(balls), len(cloud.ids), happened.lost, happened.placed]
            rows.append([frame, *counts, *numbers, report.milliseconds(float(np.median(milliseconds)))])
            print(rows[-1], flush=True)
    headers = [
        "frame",
        "balls",
        "particles",
        "lost",
        "placed",
        "distance / R, RMS",
        "variation of spacing",
        "covered",
        "ms a frame",
    ]
    return report.table(headers, [[str(cell) for cell in row] for row in rows])


def count_table() -> str:
    """How long many particles take, on the CPU."""
    scene = SCENES["dam_break"]
    balls = scene.make_balls()
    rows = []
    for count in COUNTS:
        particles = meniscus.SurfaceParticles(count)
        seconds = [_seconds(partial(particles.seed, balls, scene.field))]
        seconds += [_seconds(partial(particles.follow, balls, scene.field, 0.0)) for _ in range(COUNT_FRAMES)]
        rows.append(
            [str(len(particles.cloud.ids)), *(report.milliseconds(1e3 * each) for each in (seconds[0], min(seconds[1:])))]
        )
        print(rows[-1], flush=True)
    return report.table(["particles", "to place, ms", "a frame, ms"], rows)


def _seconds(action: Callable[[], object]) -> float:
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def seeded(balls: meniscus.Balls, count: int) -> meniscus.SurfaceParticles:
    """Particles on a fluid that stands still."""
    particles = meniscus.SurfaceParticles(count, steps=FOUNTAIN_STEPS)
    particles.seed(balls, FIELD)
    return particles


def distance_rms(cloud: ParticleCloud, balls: meniscus.Balls) -> float:
    """From the surface, influence radii: along the normals, by the oracle."""
    ahead = 0.05 * float(balls.radii[0])
    t, _ = meniscus.oracle.cast(balls, FIELD, cloud.positions + ahead * cloud.normals, -cloud.normals)
    return float(np.sqrt(np.mean((t - ahead) ** 2))) / float(balls.radii[0])


def variation(cloud: ParticleCloud) -> float:
    """Standard deviation of the distances to the nearest neighbour, by their mean; of some particles."""
    chosen = np.random.default_rng(1).permutation(len(cloud.ids))[:PROBES]
    nearest = _nearest(cloud.positions[chosen], cloud.normals[chosen], cloud, own=chosen)
    return float(np.std(nearest) / np.mean(nearest))


def covered(balls: meniscus.Balls, cloud: ParticleCloud) -> float:
    """The share of points of the surface that have a particle within 1.2 distances of an even spread."""
    points, normals = surface_points(balls)
    distance = _nearest(points, normals, cloud)
    return float(np.mean(distance < 1.2 * np.median(cloud.spacings)))


def surface_points(balls: meniscus.Balls) -> tuple[FloatArray, FloatArray]:
    """Where rays from random places around meet the surface, and its normals there."""
    random = np.random.default_rng(2)
    low, high = balls.bounds
    targets = balls.positions[random.integers(0, len(balls), 3 * PROBES)] + random.normal(
        scale=balls.radii[0] / 3, size=(3 * PROBES, 3)
    )
    directions = random.normal(size=(3 * PROBES, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = targets - 2 * float(np.linalg.norm(high - low)) * directions
    t, normals = meniscus.oracle.cast(balls, FIELD, origins, directions)
    hit = np.flatnonzero(np.isfinite(t))[:PROBES]
    return origins[hit] + t[hit, None] * directions[hit], normals[hit]


def _nearest(
    points: FloatArray, normals: FloatArray, cloud: ParticleCloud, own: npt.NDArray[np.int64] | None = None
) -> FloatArray:
    """The distance to the nearest particle that faces the same way."""
    found = []
    for begin in range(0, len(points), 100):
        part = slice(begin, begin + 100)
        distance = np.linalg.norm(points[part, None].astype(np.float64) - cloud.positions, axis=2)
        distance[normals[part] @ cloud.normals.T <= 0] = np.inf
        if own is not None:
            distance[np.arange(len(distance)), own[part]] = np.inf
        found.append(distance.min(axis=1))
    return np.concatenate(found)


def save_figure_9() -> None:
    """How particles spread over a cylinder from one of its ends: pictures, and how much of it they cover in time."""
    balls = cylinder()
    points, normals = surface_points(balls)
    even = even_distance(balls, points)
    curves: dict[str, list[float]] = {}
    rows = []
    for name, disperses in zip(LINES, (False, True), strict=True):
        particles = meniscus.SurfaceParticles(FIGURE_9_COUNT, steps=1, disperses=disperses, fills_gaps=False)
        particles.seed(balls, FIELD, cylinder_start(FIGURE_9_COUNT))
        curves[name], pictures = [], []
        for frame in range(FIGURE_9_SECONDS * FRAME_RATE + 1):
            if frame:
                particles.follow(balls, FIELD, 1 / FRAME_RATE)
            cloud = particles.cloud
            curves[name].append(float(np.mean(_nearest(points, normals, cloud) < even)))
            if frame % FRAME_RATE == 0:
                pictures.append(cylinder_picture(balls, cloud))
        rows.append(np.concatenate(pictures, axis=1))
        print(name, [round(value, 3) for value in curves[name][::FRAME_RATE]], flush=True)
    save(np.concatenate(rows, axis=0), "figure_9_pictures")
    save_plot(curves)


def even_distance(balls: meniscus.Balls, points: FloatArray) -> float:
    """Between neighbours of a hexagonal lattice of as many particles over the cylinder."""
    radius = float(np.median(np.linalg.norm(points[:, 1:], axis=1)))
    area = 2 * np.pi * radius * (float(np.ptp(balls.positions[:, 0])) + 2 * radius)
    return float(np.sqrt(2 * area / (np.sqrt(3) * FIGURE_9_COUNT)))


def cylinder_picture(balls: meniscus.Balls, cloud: ParticleCloud) -> FloatArray:
    """The fluid, and its particles as dots."""
    camera = meniscus.Camera.orthographic((0, -6, 2), (0, 0, 0), scale=2.1, width=640, height=170)
    look = meniscus.Look(style="headlight", color=(0.25, 0.45, 0.7))
    fluid = meniscus.render(balls, camera, FIELD, method="tile_caster", passes=("depth", "combined"), look=look)
    dots = meniscus.Balls(cloud.positions, 0.03 * 1.5)
    dot_look = replace(look, color=(0.95, 0.85, 0.3))
    shown = meniscus.render(dots, camera, FIELD, display="spheres", backend="cpu", passes=("depth", "combined"), look=dot_look)
    is_dot = shown["depth"] < fluid["depth"] + 0.03
    picture = np.where(is_dot[..., None], shown["combined"], fluid["combined"])[::-1]
    return srgb(picture[..., :3] + (1 - picture[..., 3:]))


def save_plot(curves: dict[str, list[float]]) -> None:
    """The share of the cylinder that is covered against time."""
    width, height = (FINER * side for side in PLOT_SIZE)
    image = Image.new("RGB", (width, height), "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(13 * FINER)
    left, right, top, bottom = 50 * FINER, width - 20 * FINER, 15 * FINER, height - 40 * FINER

    def place(seconds: float, share: float) -> tuple[float, float]:
        return left + (right - left) * seconds / FIGURE_9_SECONDS, bottom - (bottom - top) * share

    for share in np.linspace(0, 1, 5):
        draw.line((*place(0, share), *place(FIGURE_9_SECONDS, share)), fill=GRID, width=FINER)
        draw.text((left - 6 * FINER, place(0, share)[1]), f"{share:.0%}", fill=INK, font=font, anchor="rm")
    for seconds in range(FIGURE_9_SECONDS + 1):
        draw.text((place(seconds, 0)[0], bottom + 6 * FINER), f"{seconds} s", fill=INK, font=font, anchor="mt")
    for row, (name, curve) in enumerate(curves.items()):
        points = [place(frame / FRAME_RATE, share) for frame, share in enumerate(curve)]
        draw.line(points, fill=LINES[name], width=2 * FINER)
        draw.text((right - 6 * FINER, bottom - (45 - 20 * row) * FINER), name, fill=LINES[name], font=font, anchor="rm")
    save(np.asarray(image.resize(PLOT_SIZE, Image.Resampling.LANCZOS)) / 255, "figure_9_plot")


def save_figure_11() -> None:
    """A glass of water: discs as they blend, discs moved onto the surface, and the discs one by one."""
    balls = glass()
    camera = meniscus.Camera.perspective((0.4, -5.2, 2.9), (0, 0, 0.95), fov_y=0.6, width=960, height=960)
    look = meniscus.Look(style="studio", color=(0.1, 0.32, 0.55), roughness=0.15)
    shots = [{"exact": False, "particles": COUNT}, {"exact": True, "particles": COUNT}]
    parts = []
    for settings in shots:
        image = meniscus.render(balls, camera, FIELD, "surface_particles", passes=("combined",), look=look, settings=settings)
        picture = image["combined"][::-1]
        parts.append(srgb(halved(picture[..., :3] + (1 - picture[..., 3:]) * 0.85)))
    save(np.concatenate(parts, axis=1), "figure_11")


def halved(linear: npt.NDArray[np.floating]) -> FloatArray:
    """Half as wide and high."""
    rows, columns = linear.shape[:2]
    return np.asarray(np.clip(linear, 0, 1).reshape(rows // 2, 2, columns // 2, 2, 3).mean(axis=(1, 3)), np.float64)


def srgb(linear: npt.NDArray[np.floating]) -> FloatArray:
    """As it is shown."""
    linear = np.clip(linear, 0, 1)
    return np.asarray(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055), np.float64)


def save(picture: FloatArray, name: str) -> None:
    """Into docs/images."""
    path = IMAGES / f"van_kooten_2007_{name}.png"
    image = Image.fromarray(np.rint(255 * picture).astype(np.uint8))
    image.quantize(COLORS, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path} {path.stat().st_size / 1024:.0f} KiB", flush=True)


if __name__ == "__main__":
    main()
