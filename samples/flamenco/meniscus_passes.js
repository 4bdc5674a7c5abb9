// SPDX-License-Identifier: GPL-3.0-or-later

// A job type for Flamenco 3: the passes of Meniscus, frame ranges spread over the workers. Put this file into the folder "scripts"
// beside the Flamenco Manager. Meniscus must be enabled on every worker.

const JOB_TYPE = {
    label: "Meniscus Passes",
    description: "Render the passes of particle fluids to OpenEXR files. A job that was stopped goes on where files are missing",
    settings: [
        { key: "frames", type: "string", required: true,
          eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
          evalInfo: { showLinkButton: true, description: "Scene frame range" },
          description: "Frames to render, such as 47, 1-30 or 3, 5-10, 47-327" },
        { key: "chunk_size", type: "int32", default: 10, visible: "submission",
          description: "Frames of a task: reading a scene takes its time, so that a task should have several" },
        { key: "passes", type: "string", default: "combined,depth,normal",
          description: "Names with commas between, as on Meniscus' command line" },
        { key: "layout", type: "string", default: "multilayer", choices: ["multilayer", "multipart", "passes"],
          description: "All passes in one part of a file, each in a part of its own, or each in a file of its own" },
        { key: "deep", type: "bool", default: false,
          description: "Write a deep file beside each frame's others" },
        { key: "overwrite", type: "bool", default: false,
          description: "Render frames again whose files are there" },
        { key: "view_layer", type: "string", required: false, eval: "C.view_layer.name",
          description: "The view layer to render" },
        { key: "render_output_root", type: "string", subtype: "dir_path", required: true, visible: "submission",
          description: "Base folder of where the files go" },
        { key: "render_output_path", type: "string", subtype: "file_path", editable: false,
          eval: "str(Path(abspath(settings.render_output_root)) / jobname / 'fluid_######.exr')",
          description: "Final file path of where the files go" },
        { key: "blendfile", type: "string", required: true, visible: "web",
          description: "Path of the Blend file to render" },
        { key: "scene", type: "string", required: true, visible: "web", eval: "C.scene.name",
          description: "Name of the scene to render" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const task = author.Task(`passes-${chunk}`, "blender");
        task.addCommand(author.Command("blender-render", {
            exe: "{blender}",
            exeArgs: "{blenderArgs}",
            argsBefore: [],
            blendfile: settings.blendfile,
            args: renderArguments(settings, chunk),
        }, steps(chunk)));
        job.addTask(task);
    }
}

// How many frames the Worker will hear of; Managers that count no steps have no such function.
function steps(chunk) {
    return typeof frameCount === "function" ? frameCount(chunk) : 0;
}

// What follows the Blend file on the command line; everything behind --command belongs to Meniscus.
function renderArguments(settings, chunk) {
    const args = ["--scene", settings.scene, "--command", "meniscus", "render"];
    args.push("--frames=" + meniscusFrames(chunk));
    args.push("--output", settings.render_output_path);
    args.push("--passes", settings.passes, "--layout", settings.layout);
    args.push(settings.overwrite ? "--overwrite" : "--no-overwrite");
    if (settings.deep) args.push("--deep");
    if (settings.view_layer) args.push("--view-layer", settings.view_layer);
    return args;
}

// From 3,5-10 to 3,5:10; a minus before a number stays.
function meniscusFrames(chunk) {
    return chunk.replace(/\s/g, "").replace(/(\d)-/g, "$1:");
}
