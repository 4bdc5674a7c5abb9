"""The job type for Flamenco, in a JavaScript engine, with what its Manager gives to scripts."""

import itertools
import json
import shlex
from pathlib import Path

import pytest
from py_mini_racer import MiniRacer

from meniscus.addon.blender.command_line_arguments import parse_arguments

SCRIPT = Path(__file__).resolve().parents[2] / "samples" / "flamenco" / "meniscus_passes.js"
# As Flamenco 3 has it. Chunks are in order, each frame once; runs of three and more are written FIRST-LAST.
MANAGER = """
var tasks = [];
var author = {
    Task: function (name, type) {
        if (!name.trim() || !type.trim()) throw new Error("name and type are required");
        return { name: name, type: type, commands: [], addCommand: function (command) { this.commands.push(command); } };
    },
    Command: function (name, parameters, steps) { return { name: name, parameters: parameters, steps: steps || 0 }; },
};
function exploded(frames) {
    const numbers = new Set();
    for (const part of frames.replaceAll("..", "-").split(",")) {
        const ends = part.split("-").map((text) => text.trim());
        if (ends.length > 2 || !ends.every((text) => /^[0-9]+$/.test(text))) throw new Error("invalid range " + frames);
        for (let frame = Number(ends[0]); frame <= Number(ends[ends.length - 1]); frame++) numbers.add(frame);
    }
    return [...numbers].sort((a, b) => a - b);
}
function merged(numbers) {
    const runs = [];
    for (const number of numbers) {
        const run = runs[runs.length - 1];
        if (run && run[run.length - 1] === number - 1) run.push(number); else runs.push([number]);
    }
    return runs.map((run) => run.length < 3 ? run.join(",") : run[0] + "-" + run[run.length - 1]).join(",");
}
function frameChunker(frames, size) {
    const numbers = exploded(frames), chunks = [];
    for (let start = 0; start < numbers.length; start += size) chunks.push(merged(numbers.slice(start, start + size)));
    return chunks;
}
function compiled(settings) {
    tasks = [];
    compileJob({ settings: settings, addTask: function (task) { tasks.push(task); } });
    return JSON.stringify(tasks);
}
"""
COUNTS_STEPS = "function frameCount(frames) { return exploded(frames).length; }\n"
SETTING_KEYS = {
    *("key", "type", "subtype", "choices", "propargs", "description"),
    *("default", "eval", "evalInfo", "visible", "required", "editable"),
}
SETTINGS = {
    "frames": "1-20, 25",
    "chunk_size": 10,
    "passes": "depth,ball_id",
    "layout": "multipart",
    "deep": True,
    "overwrite": False,
    "view_layer": "Spray",
    "render_output_path": "/shows/shot 7/fluid_######.exr",
    "blendfile": "/shows/shot.blend",
    "scene": "Sea",
}


@pytest.fixture
def compile_job():
    """Compiles a job; its tasks as plain data."""

    def compile_(manager=MANAGER + COUNTS_STEPS, **changes):
        engine = MiniRacer()
        engine.eval(SCRIPT.read_text(encoding="utf-8") + manager)
        return json.loads(engine.eval(f"compiled({json.dumps(SETTINGS | changes)})"))

    return compile_


def blender_arguments(task, blender_args="-b -y"):
    """What the Worker starts: its own arguments come first, split as a shell does, then what is before and behind the file."""
    (command,) = task["commands"]
    parameters = command["parameters"]
    assert command["name"] == "blender-render"
    assert (parameters["exe"], parameters["exeArgs"]) == ("{blender}", "{blenderArgs}")
    return [*shlex.split(blender_args), *parameters["argsBefore"], parameters["blendfile"], *parameters["args"]]


def meniscus_options(task):
    """The options that Meniscus gets from the task."""
    arguments = blender_arguments(task)
    assert arguments[:7] == ["-b", "-y", "/shows/shot.blend", "--scene", "Sea", "--command", "meniscus"]
    assert all(isinstance(argument, str) for argument in arguments)
    return parse_arguments(arguments[7:])


def test_the_tasks_have_each_frame_once(compile_job):
    tasks = compile_job(frames="1-20, 25, 3..5, 41, 42, 44-46", chunk_size=8)
    chunks = ["1-8", "9-16", "17-20,25,41,42,44", "45,46"]
    assert [(task["name"], task["type"]) for task in tasks] == [(f"passes-{chunk}", "blender") for chunk in chunks]
    frames = [meniscus_options(task).frames for task in tasks]
    assert list(itertools.chain(*frames)) == [*range(1, 21), 25, 41, 42, 44, 45, 46]
    assert [task["commands"][0]["steps"] for task in tasks] == [len(chunk) for chunk in frames]


def test_settings_become_options(compile_job):
    options = meniscus_options(compile_job()[0])
    assert (options.output, options.layout, options.deep) == ("/shows/shot 7/fluid_######.exr", "multipart", True)
    assert (options.passes, options.view_layer, options.overwrite) == (("depth", "ball_id"), "Spray", False)


def test_what_is_off_is_not_asked_for(compile_job):
    options = meniscus_options(compile_job(frames="7", deep=False, overwrite=True, view_layer="")[0])
    assert options.frames == (7,)
    assert (options.deep, options.overwrite, options.view_layer) == (False, True, None)


def test_managers_that_count_no_steps(compile_job):
    (task,) = compile_job(manager=MANAGER, frames="1-3")
    assert task["commands"][0]["steps"] == 0


def test_the_settings_are_those_that_the_compiler_uses():
    engine = MiniRacer()
    engine.eval(SCRIPT.read_text(encoding="utf-8"))
    job_type = json.loads(engine.eval("JSON.stringify(JOB_TYPE)"))
    keys = {setting["key"] for setting in job_type["settings"]}
    assert keys >= set(SETTINGS)
    for setting in job_type["settings"]:
        assert setting["type"] in {"string", "int32", "float", "bool"}
        assert setting.get("subtype", "file_path") in {"file_path", "dir_path", "file_name", "hashed_file_path"}
        assert setting.get("visible", "visible") in {"visible", "hidden", "submission", "web"}
        assert set(setting) <= SETTING_KEYS
    assert job_type["label"]
