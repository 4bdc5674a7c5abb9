"""Real Blenders to test in: Debian's packages, each in a Debian system of its own under the cache (needs root).

    python3 tools/debian_blender.py blender-4.3 | blender-5.2             set it up
    python3 tools/debian_blender.py blender-5.2 COMMAND [ARGUMENT ...]    run a command inside, for instance blender

Nothing outside the folder changes: its proc and dev are mounted in a private namespace that ends with the command, so no
mount is ever left behind and the folder can be deleted at any time.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from project import CACHE, ToolError, command_line, fingerprint, locked, output_of
from system_packages import apt_install, is_root_on_debian

STAMP = "meniscus-stamp"
PACKAGES = [
    "blender",
    "libegl1",
    "libgl1",
    "libgl1-mesa-dri",
    "mesa-vulkan-drivers",
    "python3-numpy",
    "xauth",
    "xdotool",
    "xvfb",
]

# Run under sh in a mount namespace of its own: $0 is the system's folder, the rest is the command.
ENTER = 'mount --rbind /dev "$0/dev" && mount -t proc proc "$0/proc" && exec chroot "$0" "$@"'


@dataclass(frozen=True)
class DebianBlender:
    """A Debian release, what it needs besides `PACKAGES`, and the first number of the Blender that it must bring."""

    suite: str
    packages: tuple[str, ...]
    major: int

    @property
    def folder(self) -> Path:
        return CACHE / "blender" / f"debian-{self.suite}"


# Blender 5's extension tools import cattr and requests, which sid's package does not ask for.
PROGRAMS = {
    "blender-4.3": DebianBlender("trixie", (), 4),
    "blender-5.2": DebianBlender("sid", ("python3-cattr", "python3-requests"), 5),
}


def ensure(name: str) -> DebianBlender:
    """Set the Blender up, or leave it as it is when nothing has changed since."""
    program = PROGRAMS[name]
    stamp = fingerprint(Path(__file__))
    with locked(name):
        if not is_whole(program.folder, stamp):
            check_possible()
            partial = program.folder.with_suffix(".partial")
            remove_system(partial)
            bootstrap(program, partial)
            install(program, partial)
            check_version(program, partial)
            remove_system(program.folder)
            partial.rename(program.folder)
            (program.folder / STAMP).write_text(stamp)
    return program


def is_whole(folder: Path, stamp: str) -> bool:
    return (folder / STAMP).is_file() and (folder / STAMP).read_text() == stamp


def check_possible() -> None:
    if platform.machine() != "x86_64":
        raise ToolError("Debian's Blender is set up on x86_64 only; name this machine's own with BLENDER=/path/to/blender.")
    if not is_root_on_debian():
        raise ToolError(
            "Debian's Blender needs root on Debian or Ubuntu; an installed one can be named with BLENDER=/path/to/blender."
        )
    if shutil.which("debootstrap") is None:
        apt_install(["debootstrap", "debian-archive-keyring"])


def bootstrap(program: DebianBlender, folder: Path) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True)
    command = ["debootstrap", "--variant=minbase", program.suite, str(folder), *debian_mirror()]
    # debootstrap mounts proc and sys inside the folder: in a namespace of its own they go when it ends, however it ends.
    log = output_of(["unshare", "--mount", "--propagation", "private", *command])
    (folder / "var" / "log" / "debootstrap.log").write_text(log)


def debian_mirror() -> list[str]:
    """The machine's own Debian mirror; empty where it has none, then debootstrap takes its default."""
    if "ID=debian" not in Path("/etc/os-release").read_text().replace('"', ""):
        return []
    folder = Path("/etc/apt")
    listings = [folder / "sources.list", *sorted(folder.glob("sources.list.d/*.list"))]
    one_line = [line for path in listings if path.is_file() for line in path.read_text().splitlines()]
    found = [match[1] for line in one_line if (match := re.match(r"deb\s+(?:\[[^]]*\]\s+)?(\S+)\s+\w+\s+main\b", line))]
    for path in sorted(folder.glob("sources.list.d/*.sources")):
        found += re.findall(r"^URIs:\s*(\S+)", path.read_text(), re.MULTILINE)
    return [uri for uri in found if re.search(r"/debian/?$", uri)][:1]


def install(program: DebianBlender, folder: Path) -> None:
    # Mirrors of the unstable release may be snapshots whose signature has expired.
    (folder / "etc/apt/apt.conf.d/90meniscus").write_text('Acquire::Check-Valid-Until "false";\n')
    shutil.copy("/etc/resolv.conf", folder / "etc/resolv.conf")
    (folder / "etc/mtab").symlink_to("/proc/self/mounts")  # Blender looks for the mounted file systems there
    apt_get = ["env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-qq"]
    packages = [*PACKAGES, *program.packages]
    output_of(command_inside(folder, [*apt_get, "update"]))
    output_of(command_inside(folder, [*apt_get, "install", "-y", "--no-install-recommends", *packages]))
    output_of(command_inside(folder, ["apt-get", "clean"]))


def check_version(program: DebianBlender, folder: Path) -> None:
    version = output_of(command_inside(folder, ["blender", "--version"]))
    if not version.startswith(f"Blender {program.major}."):
        raise ToolError(f"Debian {program.suite} has {version.splitlines()[0]}, and Blender {program.major} was expected.")


def command_inside(folder: Path, command: Sequence[str]) -> list[str]:
    """The command line that runs `command` inside the system in `folder`."""
    clean = ["env", "-i", "HOME=/root", "LC_ALL=C.UTF-8", "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"]
    proxies = ("http_proxy", "https_proxy", "no_proxy")
    network = [f"{name}={value}" for name, value in os.environ.items() if name.lower() in proxies]
    namespace = ["unshare", "--mount", "--propagation", "private", "sh", "-c", ENTER]
    return [*namespace, str(folder), *clean, *network, *command]


def remove_system(folder: Path) -> None:
    """Delete a system, never through a mount."""
    live = mounts_below(folder)
    if live:
        raise ToolError(f"Something is mounted below {folder}; unmount it first: {' '.join(live)}")
    if folder.exists():
        shutil.rmtree(folder)


def mounts_below(folder: Path) -> list[str]:
    mounts = [line.split()[1] for line in Path("/proc/self/mounts").read_text().splitlines()]
    return [mount for mount in mounts if mount.startswith(f"{folder}/")]


def main(arguments: list[str]) -> int:
    if not arguments or arguments[0] not in PROGRAMS:
        raise ToolError(f"say which Blender: {', '.join(PROGRAMS)}")
    name, *command = arguments
    program = ensure(name)
    if not command:
        return 0
    return subprocess.run(command_inside(program.folder, command), check=False).returncode


if __name__ == "__main__":
    command_line(main)
