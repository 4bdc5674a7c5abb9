"""The experiments of Kanamori, Szego and Nishita 2008: their scenes, tables and pictures. No times are asserted."""

import re
from dataclasses import fields

import numpy as np
import pytest
from bench import figure_2, kanamori_2008, paper_pictures, report
from bench.kanamori_2008 import CASES, COUNTING, CPU, GPU, SWITCHES, WITHOUT
from bench.measure import Row
from bench.renderers import Picture
from bench.scenes import SCENES
from bench.timing import Statistics

from meniscus.gpu_shaders.methods.depth_peeling.options import Options
from meniscus.samples import dam_break

PAGE = kanamori_2008.PAGE.read_text(encoding="utf-8")


def one(median):
    return Statistics(median, median, median, median, median, 1)


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("figure_1", 1000),
        ("table_1_10k", 10_000),
        ("table_1_50k", 50_000),
        ("table_1_100k", 100_000),
        ("table_1_200k", 200_000),
        ("figure_2", 4),
        ("figure_11", 2878),
        ("figure_12_early", 51_849),
        ("figure_12_full", 100_000),
    ],
)
def test_a_scene_has_as_many_balls_as_the_page_says(name, count):
    scene = SCENES[f"kanamori_{name}"]
    assert len(scene.make_balls()) == count
    assert scene.field.kernel == "wyvill"
    assert (
        scene.name in PAGE or f"`{scene.name.removeprefix('kanamori_table_1_')}`" in PAGE or f"`_{name.split('_')[-1]}`" in PAGE
    )


def test_the_sizes_of_random_balls_keep_their_overlap():
    radii = [np.sort(SCENES[f"kanamori_table_1_{count}k"].make_balls().radii) for count in (10, 100)]
    assert np.median(radii[0]) / np.median(radii[1]) == pytest.approx(10 ** (1 / 3), rel=0.02)


def test_the_ray_of_figure_2_crosses_as_in_the_paper():
    scene = SCENES["kanamori_figure_2"]
    balls = scene.make_balls()
    t = figure_2.crossings(balls)
    points = np.stack([figure_2.START + (t[1:] + t[:-1]) / 2, np.zeros(5), np.zeros(5)], axis=1)
    distances = np.linalg.norm(points[:, None] - balls.positions, axis=-1)
    inside = [set(np.flatnonzero(row).tolist()) for row in distances < balls.radii]
    assert inside == [{2}, {1, 2}, {1, 2, 3}, {1, 3}, {3}]
    assert t[2] < figure_2.first_hit(balls, scene.field) < t[3]


def test_the_drawing_of_figure_2_is_filled_where_the_fluid_is():
    scene = SCENES["kanamori_figure_2"]
    drawing = np.asarray(figure_2.draw(scene.make_balls(), scene.field)).astype(int)
    assert drawing.shape == (480, 640, 3)
    fluid = np.all(np.abs(drawing - (0xC3, 0xDA, 0xF0)) < 8, axis=-1)
    assert 0.1 < fluid.mean() < 0.3
    # Nothing is cut off: the margin is paper.
    margin = np.concatenate([drawing[:5].reshape(-1, 3), drawing[-5:].reshape(-1, 3), drawing[:, :5].reshape(-1, 3)])
    assert margin.min() > 250


def test_the_papers_times_are_those_that_it_prints():
    assert len(CASES) == 14
    by_picture = {case.picture: case for case in CASES}
    case = by_picture[Picture("kanamori_table_1_200k", 1024, 768)]
    assert (case.cpu, case.gpu) == (5491.3, 980.4)
    # 23.1 frames a second.
    assert by_picture[Picture("kanamori_figure_1", 640, 480)].gpu == 43.3
    assert {case.picture.scene for case in CASES} | {"kanamori_figure_2"} == set(kanamori_2008.SCENE_NAMES)


def test_the_switches_are_all_of_the_methods_options():
    assert {*SWITCHES, "diagnostics"} == {field.name for field in fields(Options)}
    assert all(field.default is (field.name != "diagnostics") for field in fields(Options))


def cells(table):
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]


def test_a_case_that_fails_keeps_its_row_beside_the_papers_times():
    cases = [CASES[0], CASES[1]]
    rows = [
        Row(cases[0].picture, GPU, {"render": one(433.0)}, {"balls": 1000}, ""),
        Row(cases[0].picture, CPU, {"render": one(10.0)}, {"balls": 1000}, ""),
        Row(cases[1].picture, GPU, {}, {}, "no OpenGL"),
        Row(cases[1].picture, CPU, {"render": one(58.95)}, {"balls": 10_000}, ""),
    ]
    first, second = cells(kanamori_2008.times_table(cases, rows))
    assert first == ["figure 1", "kanamori_figure_1", "1000", "640x480", "43.3", "433", "0.10", "", "10.0", "", "43"]
    assert second[4:] == ["117.1", "no OpenGL", "", "589.5", "59.0", "10", ""]


def test_each_optimisation_has_a_row_and_each_scene_its_counts():
    picture = Picture("kanamori_figure_11", 640, 480)
    counts = {"balls_kept": 500, "bezier_solves": 100, "bezier_iterations": 250, "bezier_iterations_max": 9}
    rows = [Row(picture, GPU, {"render": one(200.0)}, {}, "")]
    rows += [Row(picture, variant, {"render": one(300.0)}, {}, "") for variant in WITHOUT.values()]
    rows += [Row(picture, COUNTING, {"render": one(900.0)}, {"balls": 2000, "counts": counts}, "")]
    table = cells(kanamori_2008.switches_table(rows))
    assert table[0] == ["all switched on", "200"]
    assert table[1:] == [[f"without {name}", "300, x 1.50"] for name in SWITCHES]
    assert cells(kanamori_2008.counts_table(rows)) == [["kanamori_figure_11", "2000", "500", "25%", "2.50", "9"]]
    rows[-1] = Row(picture, COUNTING, {}, {}, "crashed")
    assert cells(kanamori_2008.counts_table(rows)) == [["kanamori_figure_11", "", "crashed", "", "", ""]]


def test_the_page_has_a_place_for_the_tables_and_shows_every_picture():
    assert "new table" in report.with_section(PAGE, kanamori_2008.NAME, "new table")
    shown = set(re.findall(r"images/kanamori_2008_(\w+)\.png", PAGE))
    assert shown == set(paper_pictures.PICTURES)
    assert all((paper_pictures.FOLDER / f"kanamori_2008_{name}.png").exists() for name in shown)


def test_a_box_is_entered_and_left_where_its_planes_are():
    camera = SCENES["kanamori_figure_10_whole"].camera(None, 32, 24)
    (enter, entered), (leave, left) = paper_pictures._box(camera, (0.0, 0.0, 0.0), dam_break.TANK)
    meets = np.isfinite(enter)
    assert 0.2 < meets.mean() < 0.9
    assert np.array_equal(meets, np.isfinite(leave))
    eye, directions = paper_pictures._rays(camera)
    for depth, axis in ((enter, entered), (leave, left)):
        points = eye + depth[meets, None] * directions[meets]
        on_face = np.take_along_axis(points, axis[meets, None], axis=1)[:, 0]
        faces = np.array(dam_break.TANK)[axis[meets]]
        assert np.all(np.isclose(on_face, 0, atol=1e-9) | np.isclose(on_face, faces))
        assert np.all((points > -1e-9) & (points < np.array(dam_break.TANK) + 1e-9))
    assert np.all(enter[meets] < leave[meets])
