"""The job type for Flamenco, in a JavaScript engine, with what its Manager gives to scripts."""

import json
from pathlib import Path

import pytest
from py_mini_racer import MiniRacer

from meniscus.addon.blender.command_line_arguments import parse_arguments

SCRIPT = Path(__file__).resolve().parents[2] / "samples" / "flamenco" / "meniscus_passes.js"
# As Flamenco 3 documents it: author.Task(name, type), author.Command(name, parameters), frameChunker(frames, size).
MANAGER = """
var tasks = [];
var author = {
    Task: function (name, type) {
        return { name: name, type: type, commands: [], addCommand: function (command) { this.commands.push(command); } };
    },
    Command: function (name, parameters) { return { name: name, parameters: parameters }; },
};
function frameChunker(frames, size) { chunker_asked = [frames, size]; return CHUNKS; }
var chunker_asked;
function compiled(settings) {
    tasks = [];
    compileJob({ settings: settings, addTask: function (task) { tasks.push(task); } });
    return JSON.stringify(tasks);
}
"""
SETTINGS = {
    "frames": "1-20, 25",
    "chunk_size": 10,
    "passes": "depth,ball_id",
    "layout": "multipart",
    "deep": True,
    "overwrite": False,
    "view_layer": "Spray",
    "render_output_path": "/farm/shot 7/fluid_######.exr",
    "blendfile": "/farm/shot.blend",
    "scene": "Sea",
}


@pytest.fixture
def compile_job():
    """Compiles a job whose frames are chunked so; its tasks as plain data."""

    def compile_(chunks, **changes):
        engine = MiniRacer()
        engine.eval(SCRIPT.read_text(encoding="utf-8") + MANAGER.replace("CHUNKS", json.dumps(chunks)))
        return json.loads(engine.eval(f"compiled({json.dumps(SETTINGS | changes)})"))

    return compile_


def test_each_chunk_is_a_task_that_runs_blender(compile_job):
    tasks = compile_job(["1-10", "11-20,25"])
    assert [(task["name"], task["type"]) for task in tasks] == [("passes-1-10", "blender"), ("passes-11-20,25", "blender")]
    (command,) = tasks[1]["commands"]
    assert command["name"] == "blender-render"
    parameters = command["parameters"]
    assert set(parameters) == {"exe", "exeArgs", "argsBefore", "blendfile", "args"}
    assert (parameters["exe"], parameters["exeArgs"], parameters["blendfile"]) == (
        "{blender}",
        "{blenderArgs}",
        "/farm/shot.blend",
    )


def test_meniscus_understands_the_arguments(compile_job):
    (task,) = compile_job(["11-20,25"])
    args = task["commands"][0]["parameters"]["args"]
    assert args[: args.index("--command") + 2] == ["--scene", "Sea", "--command", "meniscus"]
    options = parse_arguments(args[args.index("meniscus") + 1 :])
    assert options.frames == (*range(11, 21), 25)
    assert (options.output, options.layout, options.deep) == ("/farm/shot 7/fluid_######.exr", "multipart", True)
    assert (options.passes, options.view_layer, options.overwrite) == (("depth", "ball_id"), "Spray", False)


def test_what_is_off_is_not_asked_for(compile_job):
    (task,) = compile_job(["-5-3"], deep=False, overwrite=True, view_layer="")
    args = task["commands"][0]["parameters"]["args"]
    options = parse_arguments(args[args.index("meniscus") + 1 :])
    assert options.frames == tuple(range(-5, 4))
    assert (options.deep, options.overwrite, options.view_layer) == (False, True, None)


def test_the_settings_are_those_that_the_compiler_uses():
    engine = MiniRacer()
    engine.eval(SCRIPT.read_text(encoding="utf-8"))
    job_type = json.loads(engine.eval("JSON.stringify(JOB_TYPE)"))
    keys = {setting["key"] for setting in job_type["settings"]}
    assert keys >= set(SETTINGS)
    known = {"string", "int32", "float", "bool"}
    assert all(setting["type"] in known for setting in job_type["settings"])
    assert job_type["label"]
