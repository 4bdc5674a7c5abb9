"""What can be said on the command line."""

import pytest

from meniscus.addon.blender.command_line_arguments import parse_arguments


def parsed(*arguments: str) -> object:
    return parse_arguments(["render", "--output", "//fluid_####.exr", *arguments])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("7", (7,)),
        ("1:4", (1, 2, 3, 4)),
        ("3:3", (3,)),
        ("1:10:4", (1, 5, 9)),
        ("20,1:3,2,5:6", (20, 1, 2, 3, 5, 6)),
        ("-2:1", (-2, -1, 0, 1)),
    ],
)
def test_frames_are_listed_in_their_order_and_each_once(text: str, expected: tuple[int, ...]) -> None:
    assert parsed(f"--frames={text}").frames == expected


def test_what_is_left_out_is_left_to_the_scene() -> None:
    options = parsed()
    assert options.output == "//fluid_####.exr"
    left_to_scene = (options.frames, options.camera, options.resolution, options.method, options.backend, options.view_layer)
    assert left_to_scene == (None,) * 6
    assert (options.passes, options.compression, options.preview, options.json) == (("depth", "normal"), "ZIP", False, None)


def test_all_options_arrive() -> None:
    options = parsed(
        *(
            "--camera",
            "Side Camera",
            "--resolution",
            "640X480",
            "--passes",
            "normal, depth,normal",
            "--method",
            "depth_peeling",
        ),
        *("--setting", "step=0.5", "--setting", "name = a=b"),
        *("--backend", "gpu", "--compression", "PIZ", "--view-layer", "Spray", "--preview", "--json", "-"),
    )
    assert (options.camera, options.resolution, options.passes) == ("Side Camera", (640, 480), ("normal", "depth"))
    assert (options.method, options.backend, options.compression) == ("depth_peeling", "gpu", "PIZ")
    assert (options.view_layer, options.preview, options.json) == ("Spray", True, "-")
    assert options.setting == [("step", "0.5"), ("name", "a=b")]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--setting", "step"], "'step' is no setting; write NAME=VALUE"),
        (["--setting", "=3"], "'=3' is no setting; write NAME=VALUE"),
        (["--setting", "step="], "'step=' is no setting; write NAME=VALUE"),
        (["--frames", "10:1"], "the range '10:1' runs backwards; write 1:10"),
        (["--frames", "1:10:0"], "the step of '1:10:0' must be at least 1"),
        (["--frames", "1-10"], "'1-10' is no frame range; write N, FIRST:LAST or FIRST:LAST:STEP"),
        (["--frames", "1,,2"], "'' is no frame range"),
        (["--frames", "0:99999999999"], "beyond Blender's last frame, 1048574"),
        (["--resolution", "640"], "'640' is no image size; write WIDTHxHEIGHT"),
        (["--resolution", "0x480"], "'0x480' is no image size"),
        (["--passes", "depth,mist"], "Unknown pass 'mist': choose from combined, depth, normal, position"),
        (["--compression", "DWAA"], "invalid choice: 'DWAA'"),
        (["--colour"], "unrecognized arguments: --colour"),
    ],
)
def test_nonsense_gives_one_sentence_and_status_2(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        parsed(*arguments)
    assert stop.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("meniscus: ")
    assert captured.err.count("\n") == 1
    assert sentence in captured.err


@pytest.mark.parametrize(("arguments", "missing"), [([], "COMMAND"), (["render"], "--output")])
def test_what_is_required_is_named(arguments: list[str], missing: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        parse_arguments(arguments)
    assert stop.value.code == 2
    assert missing in capsys.readouterr().err


def test_help_names_every_option(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        parse_arguments(["render", "--help"])
    assert stop.value.code == 0
    shown = capsys.readouterr().out
    for option in (
        "frames",
        "output",
        "camera",
        "resolution",
        "passes",
        "method",
        "backend",
        "compression",
        "view-layer",
        "json",
    ):
        assert f"--{option}" in shown


def test_ray_tracing_is_left_to_the_scene_or_said() -> None:
    names = ("ray_tracing", "reflections", "refractions", "occlusion_rays", "light_samples")
    assert [getattr(parsed(), name) for name in names] == [None] * 5
    said = parsed("--ray-tracing", "--reflections=2", "--refractions=0", "--occlusion-rays=16", "--light-samples=4")
    assert [getattr(said, name) for name in names] == [True, 2, 0, 16, 4]
    assert parsed("--no-ray-tracing").ray_tracing is False


def test_numbers_of_rays_are_whole(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parsed("--reflections=1.5")
    assert "'1.5' is no whole number; write 0 or more" in capsys.readouterr().err
