"""The benchmarks: what they time, how they sum it up, what becomes of a case that hangs or crashes. No times are asserted."""

import argparse
import json
import os
import subprocess
import sys

import numpy as np
import pytest
from bench import accuracy, fitted_bvh, machine, options, report, run_bench, run_peers, scaling, timing
from bench.judge import Judge, Judgement
from bench.peers import cases
from bench.renderers import Picture
from bench.scenes import DENSE_JITTER, FILLED, SCENES, SIZES, dense_balls, random_balls, three_quarter_camera
from bench.timing import CaseError, Outcome, Plan, Statistics, interleave, statistics, statistics_by_stage
from bench.variants import Variant, default_methods, variants
from bench.worker import TESTS, Worker

import meniscus


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("random_1k", 1000),
        ("random_10k", 10_000),
        ("random_100k", 100_000),
        ("random_200k", 200_000),
        ("random_1m", 1_000_000),
        ("dense_120k", 120_000),
        ("dense_1m", 1_000_000),
        ("block_10k", 10_000),
        ("block_120k", 120_000),
        ("block_1m", 1_000_000),
    ],
)
def test_a_scene_has_the_balls_that_its_name_says(name, count):
    scene = SCENES[name]
    balls = scene.make_balls()
    assert (scene.name, len(balls)) == (name, count)
    assert len(np.unique(balls.radii)) == 1
    assert scene.field == meniscus.Field("wyvill", 0.4)


def test_a_ray_crosses_ten_influence_spheres_of_a_random_scene():
    balls = random_balls(20_000)
    radius = float(balls.radii[0])
    assert radius == pytest.approx(np.sqrt(10 / (np.pi * 20_000)))
    assert balls.positions.min() >= 0
    assert balls.positions.max() <= 1
    # Rays along each axis, far enough from the cube's sides that no sphere around them is cut off.
    across = np.random.default_rng(5).uniform(radius, 1 - radius, (300, 2))
    for axis in range(3):
        others = np.delete(balls.positions, axis, axis=1).astype(np.float64)
        crossed = [np.count_nonzero(((others - ray) ** 2).sum(axis=1) < radius**2) for ray in across]
        assert np.mean(crossed) == pytest.approx(10, abs=0.6)


def test_a_dense_scene_is_a_jittered_lattice_in_the_unit_cube():
    balls = dense_balls(700)
    spacing = 1 / 9
    assert balls.radii[0] == pytest.approx(2 * spacing)
    sites = np.floor(balls.positions / spacing).astype(int)
    assert len(np.unique(sites, axis=0)) == 700
    assert sites.min() == 0
    assert sites.max() == 8
    displaced = np.abs(balls.positions / spacing - sites - 0.5)
    assert 0.9 * DENSE_JITTER < displaced.max() <= DENSE_JITTER + 1e-6


@pytest.mark.parametrize("size", [*SIZES, (100, 400)])
def test_the_camera_shows_the_box_around_the_centres_as_large_as_it_fits(size):
    balls = meniscus.Balls(np.random.default_rng(1).uniform((-3, 0, 5), (-1, 0.5, 8), (500, 3)), 0.1)
    camera = three_quarter_camera(balls, *size)
    low, high = balls.positions.min(axis=0), balls.positions.max(axis=0)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, 8)
    clip = camera.clip_from_view @ camera.view_from_world @ np.concatenate([corners, np.ones((1, 8))])
    in_picture = clip[:3] / clip[3]
    assert np.abs(in_picture[:2]).max() == pytest.approx(FILLED)
    assert np.abs(in_picture[2]).max() < 1
    picture = meniscus.render(balls, three_quarter_camera(balls, 32, 24), meniscus.Field(), method="tile_caster")
    assert picture.hit[12, 16]
    assert not picture.hit[0, 0]


def test_statistics_are_those_of_the_values():
    assert statistics([5.0, 1.0, 2.0, 4.0, 3.0]) == Statistics(3.0, 2.0, 4.0, 1.0, 5.0, 5)


def test_the_warm_up_counts_only_where_it_is_all_there_is():
    cold, warm = {"build": 100.0}, {"build": 1.0, "cast": 2.0}
    assert statistics_by_stage(Outcome([cold]))["build"].median == 100
    stages = statistics_by_stage(Outcome([cold, warm, warm]))
    assert list(stages) == ["build", "cast"]
    assert (stages["build"].greatest, stages["cast"].count) == (1, 2)
    assert statistics_by_stage(Outcome(problem="crashed")) == {}


def test_cases_are_measured_in_turn_and_one_that_fails_does_not_stop_the_others():
    order = []

    def measure(name):
        order.append(name)
        if name == "bad" and order.count("bad") == 2:
            raise CaseError("crashed")
        return {"all": 1.0}

    outcomes = interleave({name: lambda name=name: measure(name) for name in ("bad", "good")}, Plan(repeats=2, budget=60))
    assert order == ["bad", "good", "bad", "good", "good"]
    assert (outcomes["bad"].problem, len(outcomes["bad"].samples)) == ("crashed", 1)
    assert (outcomes["good"].problem, len(outcomes["good"].samples)) == ("", 3)


def test_no_round_begins_after_the_budget():
    outcomes = interleave({"a": lambda: {"all": 1.0}}, Plan(repeats=50, budget=0))
    assert len(outcomes["a"].samples) == timing.WARM_UPS + 1


SERVER = """
import os, signal, sys, time
from bench.worker import serve
def handle(request):
    if request["do"] == "hang":
        time.sleep(600)
    if request["do"] == "fail":
        raise ValueError("no such thing\\nsecond line")
    if request["do"] == "exit":
        sys.exit(3)
    if request["do"].startswith("SIG"):
        os.kill(os.getpid(), getattr(signal, request["do"]))
    return {"pid": os.getpid(), "word": os.environ.get("WORD")}
serve(handle)
"""


@pytest.fixture
def start_worker(tmp_path):
    started = []

    def start(**settings):
        worker = Worker([sys.executable, "-c", SERVER], tmp_path / "worker.log", **settings)
        started.append(worker)
        return worker

    yield start
    for worker in started:
        worker.stop()


def is_running(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_worker_that_takes_too_long_is_ended_and_started_again(start_worker):
    worker = start_worker()
    first = worker.ask({"do": "answer"}, 60)["pid"]
    with pytest.raises(CaseError, match=r"^took longer than 0\.2 s to hang$"):
        worker.ask({"do": "hang"}, 0.2)
    assert not is_running(first)
    second = worker.ask({"do": "answer"}, 60)["pid"]
    assert second != first
    worker.stop()
    assert not is_running(second)


@pytest.mark.parametrize(
    ("request_", "sentence"),
    [
        ("SIGSEGV", r"crashed \(SIGSEGV\), see .*worker.log"),
        ("SIGKILL", "killed by the system, as it is when memory runs out"),
        ("exit", "ended with exit status 3, see .*worker.log"),
        ("fail", "ValueError: no such thing$"),
    ],
)
def test_a_worker_that_breaks_down_is_a_clause_in_the_report(start_worker, request_, sentence):
    worker = start_worker()
    with pytest.raises(CaseError, match=sentence):
        worker.ask({"do": request_}, 60)
    assert worker.ask({"do": "answer"}, 60)["pid"] > 0


def test_a_worker_gets_its_variables(start_worker):
    assert start_worker(variables={"WORD": "yes"}).ask({"do": "answer"}, 60)["word"] == "yes"
    assert start_worker().ask({"do": "answer"}, 60)["word"] is None


def test_tables_line_up_with_numbers_to_the_right():
    text = report.table(["scene", "ms", "why"], [["a|b", "1.50 [1, 2]", ""], ["long name", "", "took 3 s"]])
    assert text.splitlines() == [
        "| scene     |          ms | why      |",
        "| --------- | ----------: | -------- |",
        "| a/b       | 1.50 [1, 2] |          |",
        "| long name |             | took 3 s |",
    ]
    assert report.table(["a", "b"], []).splitlines() == ["| a | b |", "| - | - |"]


@pytest.mark.parametrize(("value", "text"), [(0.1234, "0.12"), (12.34, "12.3"), (99.96, "100.0"), (1234.5, "1234")])
def test_milliseconds_have_no_exponent(value, text):
    assert report.milliseconds(value) == text


def one(median):
    return Statistics(median, median - 1, median + 1, median - 2, median + 2, 9)


def test_spread_and_ratio():
    assert report.median_and_spread(one(20.0)) == "20.0 [19.0, 21.0]"
    assert report.seconds(one(2000.0)) == "2 [2, 2]"
    assert report.ratio(one(300.0), one(4.0)) == "75"
    assert report.ratio(one(5.0), one(4.0)) == "1.25"
    assert report.ratio(None, one(4.0)) == ""


def test_a_generated_section_is_replaced_and_the_rest_stays():
    document = "before\n<!-- begin bench -->\nold\n<!-- end bench -->\nafter\n"
    assert report.with_section(document, "bench", "new") == document.replace("old", "new")
    with pytest.raises(ValueError, match="no section"):
        report.with_section(document, "peers", "new")


@pytest.mark.parametrize("name", ["bench", "bench-peers"])
def test_the_document_has_a_place_for_the_tables(name):
    assert "new table" in report.with_section(report.DOCUMENT.read_text(encoding="utf-8"), name, "new table")


def test_a_report_is_written_whole(tmp_path, monkeypatch, capsys):
    document = tmp_path / "benchmarks.md"
    document.write_text("<!-- begin bench -->\n\n<!-- end bench -->\n")
    monkeypatch.setattr(report, "OUT", tmp_path / "out")
    monkeypatch.setattr(report, "DOCUMENT", document)
    report.publish("bench", {"rows": [1]}, "a table", into_document=False)
    assert json.loads((tmp_path / "out" / "bench.json").read_text()) == {"rows": [1]}
    assert (tmp_path / "out" / "bench.md").read_text() == "a table\n"
    assert "a table" not in document.read_text()
    assert "a table" in capsys.readouterr().out
    report.publish("bench", {}, "a table", into_document=True)
    assert document.read_text() == "<!-- begin bench -->\na table\n<!-- end bench -->\n"


def test_a_busy_machine_is_told():
    assert machine.load_warning(0.4, 2) == ""
    assert "load 1.37 on 2 cores" in machine.load_warning(1.37, 2)


@pytest.mark.parametrize("text", ["640", "0x480", "axb", "640x-1"])
def test_an_unusable_size_is_named(text):
    with pytest.raises(argparse.ArgumentTypeError, match=f"'{text}' is no size"):
        options.size(text)


def test_sizes_and_scenes_come_from_the_command_line():
    parser = options.parser("bench", "", ("random_1k",), Plan(), 5.0)
    chosen = parser.parse_args(["--scenes", "argon", "dense_1m", "--sizes", "64x48"])
    assert (chosen.scenes, chosen.sizes, chosen.limit) == (["argon", "dense_1m"], [(64, 48)], 5.0)


DESCRIBED = {
    "methods": [
        {"name": "depth_peeling", "backend": "gpu", "problem": "", "is_software": True},
        {"name": "tile_caster", "backend": "cpu", "problem": "", "is_software": False},
        {"name": "another", "backend": "cpu", "problem": "", "is_software": False},
    ]
}


def test_the_preferred_cpu_method_is_timed_and_opengl_only_on_hardware():
    assert default_methods(DESCRIBED) == ["tile_caster"]
    hardware = {"methods": [{**DESCRIBED["methods"][0], "is_software": False}, *DESCRIBED["methods"][1:]]}
    assert default_methods(hardware) == ["tile_caster", "depth_peeling"]
    broken = {"methods": [{**DESCRIBED["methods"][0], "problem": "no driver"}, *DESCRIBED["methods"][1:]]}
    assert default_methods(broken) == ["tile_caster"]


def test_the_native_core_has_a_row_for_each_path_on_one_thread_and_on_all():
    chosen = variants("random_100k", ["tile_caster", "depth_peeling"], ["avx2", "portable"])
    assert chosen == [
        Variant("tile_caster"),
        Variant("tile_caster", "avx2", 0),
        Variant("tile_caster", "avx2", 1),
        Variant("tile_caster", "portable", 0),
        Variant("tile_caster", "portable", 1),
        Variant("depth_peeling"),
    ]
    assert chosen[2].variables() == {"MENISCUS_SIMD": "avx2"}
    assert Variant("tile_caster").variables() == {}
    assert variants("argon", ["tile_caster"], ["avx2"]) == [Variant("tile_caster")]


def test_a_failed_variant_keeps_its_row():
    picture = Picture("random_1k", 640, 480)
    rows = [
        run_bench.Row(picture, Variant("tile_caster"), {"build": one(2.0), "render": one(10.0)}, {"balls": 1000}, ""),
        run_bench.Row(picture, Variant("tile_caster", "avx2", 1), {"render": one(15.0)}, {"balls": 1000}, ""),
        run_bench.Row(picture, Variant("depth_peeling"), {}, {}, "took longer than 1 s to render"),
    ]
    header, _, first, second, third = (
        [cell.strip() for cell in line.split("|")[1:-1]] for line in run_bench.table_of(rows).splitlines()
    )
    assert header == ["scene", "balls", "size", "method", "path", "threads", "build", "render()", "ratio"]
    assert first == ["random_1k", "1000", "640x480", "tile_caster", "", "all", "2.00", "10.0 [9.00, 11.0]", "1.00"]
    assert second[4:] == ["avx2", "1", "", "15.0 [14.0, 16.0]", "1.50"]
    assert third[3:] == ["depth_peeling", "", "all", "", "took longer than 1 s to render", ""]


def test_a_failed_peer_keeps_its_row():
    case = cases()[0]
    row = run_peers.Row("block_10k", 10_000, case, {}, {"640x480": one(20.0)}, problem="was killed")
    good = run_peers.Row("block_10k", 10_000, case, {"hand over": one(1.5), "surface": one(2000.0)}, {"640x480": one(20.0)}, 12)
    good.judgement = Judgement(accuracy.Deviation(7, 0.125, 0.0312, 4.2), 0.016)
    lines = run_peers.table_of([row, good], ["640x480"]).splitlines()
    failed, fine = ([cell.strip() for cell in line.split("|")[1:-1]] for line in lines[2:])
    assert failed[2:8] == [case.label, "was killed", "", "0.02 [0.019, 0.021]", "", ""]
    assert fine[3:] == ["2 [2, 2]", "hand over 1.50", "0.02 [0.019, 0.021]", "100", "12", "1.6%", "0.031", "4.2", "12.5%"]


def test_the_cases_are_read_without_the_peers():
    code = (
        "import sys; from bench.peers import cases; assert len(cases()) > 3; "
        "print(sorted({'bpy', 'pysplashsurf', 'meniscus'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(TESTS)}, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_a_case_is_given_influence_radii(tmp_path):
    balls = meniscus.Balls(np.random.default_rng(3).random((50, 3)), 0.25)
    camera = three_quarter_camera(balls, 64, 48)
    case = next(case for case in cases() if case.module == "metaballs")
    request = run_peers.prepare_request(tmp_path / "positions.npz", case, balls, camera)
    with np.load(request["positions"]) as saved:
        assert np.allclose(saved["positions"], balls.positions * 4)
    assert np.allclose(request["task"]["world_from_view"][:3, 3], camera.eye * 4)
    # x^3 = 0.2 at the rim of a lone ball.
    assert request["task"]["kernel_radius"] == pytest.approx(np.sqrt(1 - 0.2 ** (1 / 3)))


@pytest.fixture
def view():
    balls = random_balls(300)
    return balls, three_quarter_camera(balls, 160, 120)


def test_spheres_are_hit_where_a_lone_ball_is(view):
    _, camera = view
    field, lone = meniscus.Field("poly6", 0.2), meniscus.Balls([[0.5, 0.5, 0.5], [0.2, 0.9, 0.1]], 0.3)
    rays, _ = accuracy.pixel_rays(camera, accuracy.pixel_grid(camera, 4000))
    true = accuracy.field_hits(lone, field, rays)
    radius = float(field.kernel_radii(lone.radii[:1], lone.weights[:1])[0])
    found = accuracy.sphere_hits(lone.positions.astype(np.float64), radius, rays)
    assert np.isfinite(true.t).sum() > 100
    assert np.array_equal(np.isfinite(found.t), np.isfinite(true.t))
    far = accuracy.deviation(found, true, 0.3)
    assert far.elsewhere == 0
    assert far.distance < 1e-6
    assert far.angle < 1e-4


def test_deviation_is_that_of_known_hits():
    up, tilted = [0.0, 0.0, 1.0], [0.0, np.sin(np.radians(10)), np.cos(np.radians(10))]
    true = accuracy.Hits(np.array([1.0, 2.0, 3.0, np.inf, np.inf]), np.array([up] * 5))
    found = accuracy.Hits(np.array([1.2, 2.0, 9.0, 4.0, np.inf]), np.array([tilted, up, up, up, up]))
    far = accuracy.deviation(found, true, 0.5)
    assert far.compared == 2
    assert far.elsewhere == 0.5
    assert far.distance == pytest.approx(0.4 / np.sqrt(2))
    assert far.angle == pytest.approx(10 / np.sqrt(2))
    nothing = accuracy.Hits(np.full(5, np.inf), np.zeros((5, 3)))
    assert accuracy.deviation(nothing, true, 0.5) == accuracy.Deviation(0, 1.0, None, None)
    assert accuracy.deviation(nothing, nothing, 0.5).elsewhere == 0


def test_the_ray_of_a_points_pixel_passes_by_the_point(view):
    balls, camera = view
    points = balls.positions.astype(np.float64)
    rays, stretch = accuracy.pixel_rays(camera, accuracy.pixels_at(camera, points))
    to_point = points - rays.origins
    off = np.linalg.norm(np.cross(to_point, rays.directions), axis=1)
    pixel = max(camera.pixel_size)
    assert np.all(off <= pixel * np.linalg.norm(to_point, axis=1))
    depth = -(to_point @ camera.world_from_view[:3, 2])
    along = np.einsum("ij,ij->i", to_point, rays.directions)
    assert np.allclose(depth * stretch, along, rtol=2 * pixel)


def test_a_pixel_grid_covers_the_picture_evenly(view):
    _, camera = view
    pixels = accuracy.pixel_grid(camera, 300)
    assert 250 <= len(pixels) <= 400
    rows, columns = np.divmod(pixels, camera.width)
    assert len(np.unique(pixels)) == len(pixels)
    assert (columns.mean(), rows.mean()) == pytest.approx((camera.width / 2, camera.height / 2), abs=8)


def test_only_balls_that_meet_no_other_are_lone():
    balls = meniscus.Balls([[0, 0, 0], [1.9, 0, 0], [0, 5, 0], [0, 5, 2.1], [9, 9, 9]], 1.0)
    assert accuracy.lone_balls(balls, np.array([1, 2, 4])).tolist() == [[0, 5, 0], [9, 9, 9]]


def test_a_droplet_is_lost_where_no_probe_meets_a_surface_nearby():
    centres = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    rays = accuracy.probes(centres)
    assert len(rays.origins) == 12
    # The sphere around the second centre only; from the first, one probe meets it from afar.
    t = np.where(np.all(rays.origins == centres[1], axis=1), 0.5, np.inf)
    t[0] = 4.5
    assert accuracy.lost_share(t, 1.0) == 0.5


@pytest.fixture
def judged(tmp_path):
    """Four balls, the last two of them lone droplets, a camera, a judge, and the field that all are judged by."""
    balls = meniscus.Balls([[0, 0, 0], [0.9, 0, 0], [0, 0, 3], [3, 1, 0]], 1.0)
    camera = three_quarter_camera(balls, 64, 48)
    judge = Judge(balls, camera, 2, Worker(["unused"], tmp_path / "log"), tmp_path)
    return balls, camera, judge, meniscus.Field("poly6", 0.2)


def test_an_exact_picture_is_judged_exact_and_an_empty_one_lost(judged, tmp_path):
    balls, camera, judge, field = judged
    image = meniscus.render(balls, camera, field, method="tile_caster")
    np.savez(tmp_path / "good.npz", depth=image["depth"], normal=image["normal"])
    good = judge.own_picture(tmp_path / "good.npz", field)
    assert good.deviation.compared > 20
    assert good.deviation.elsewhere == 0
    assert good.deviation.distance < 1e-4
    assert good.deviation.angle < 0.05
    assert good.lost == 0
    np.savez(tmp_path / "empty.npz", depth=np.full((48, 64), 1e10, np.float32), normal=np.zeros((48, 64, 3), np.float32))
    empty = judge.own_picture(tmp_path / "empty.npz", field)
    assert empty == Judgement(accuracy.Deviation(0, 1.0, None, None), 1.0)


def test_a_peers_picture_is_read_the_right_way_up(judged, tmp_path):
    balls, camera, judge, field = judged
    meniscus.write_exr(tmp_path / "peer.exr", meniscus.render(balls, camera, field, method="tile_caster"))
    far = judge.picture(tmp_path / "peer.exr", "field", field).deviation
    assert far.elsewhere == 0
    assert far.distance < 1e-4
    assert far.angle < 0.05


def test_occlusion_rays_leave_the_surface_by_the_cosine():
    normals = np.array([[0.0, 0.0, 1.0], [0.6, -0.8, 0.0]])
    rays = fitted_bvh.hemisphere_rays(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), normals, 4000)
    assert np.allclose(np.linalg.norm(rays.directions, axis=1), 1)
    assert np.array_equal(np.unique(rays.origins, axis=0), [[1, 2, 3], [4, 5, 6]])
    cosines = np.einsum("nrx,nx->nr", rays.directions.reshape(2, 4000, 3), normals)
    assert cosines.min() >= 0
    # The density of the cosine c is 2 c.
    assert cosines.mean(axis=1) == pytest.approx([2 / 3, 2 / 3], abs=0.02)
    assert (cosines**2).mean(axis=1) == pytest.approx([1 / 2, 1 / 2], abs=0.02)


def test_trees_have_rays_a_second_and_core_only_where_rays_are_cast():
    rows = [
        fitted_bvh.Row("build", "dense_1m", 2, 0, one(500.0), ""),
        fitted_bvh.Row("cast", "dense_120k", 2, 1_000_000, one(250.0), ""),
        fitted_bvh.Row("cast", "dense_120k", 1, 0, None, "was killed"),
    ]
    lines = fitted_bvh.table_of(rows).splitlines()[2:]
    build, cast, failed = ([cell.strip() for cell in line.split("|")[1:-1]] for line in lines)
    assert build[3:] == ["500 [499, 501]", "", ""]
    assert cast[3:] == ["250 [249, 251]", "1000000", "2"]
    assert failed[3:] == ["was killed", "", ""]


def test_the_study_of_scaling_leaves_out_what_was_too_slow(monkeypatch):
    spent = {"tile_lists": 1.0, "depth_peeling": 900.0}
    monkeypatch.setattr(
        scaling,
        "measure",
        lambda case, balls, method: {
            "axis": case.axis, "value": scaling.value_of(case), "method": method, "milliseconds": spent[method],
        },
    )  # fmt: skip
    study = [case for case in scaling.cases(10_000, (64, 48)) if case.axis == "balls"]
    rows = scaling.measured(study, list(spent), limit=0.5)
    assert [(row["value"], row["method"]) for row in rows] == [
        ("1,000", "tile_lists"), ("1,000", "depth_peeling"), ("10,000", "tile_lists"),
    ]  # fmt: skip
    assert "900" in scaling.time_table(rows, list(spent)).splitlines()[2]
    assert scaling.time_table(rows, list(spent)).splitlines()[3].split("|")[-2].strip() == ""
