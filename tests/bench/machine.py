"""What a run was made on."""

from __future__ import annotations

import os
import platform
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import meniscus

BUSY = 0.25
"""Processes that want a core, by cores, from which on the machine counts as busy."""
SIMD_FLAGS = ("avx2", "fma", "avx512f", "asimd", "sve")


def describe() -> dict[str, Any]:
    """Plain data for the report; call it before anything is timed, because it tells the load."""
    cores = usable_cores()
    load = os.getloadavg()[0]
    return {
        "time": time.strftime("%Y-%m-%d %H:%M"),
        "processor": _cpu_info("model name") or platform.processor() or platform.machine(),
        "cores": cores,
        "simd": [flag for flag in SIMD_FLAGS if flag in _cpu_info("flags", "Features").split()],
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "moderngl": version("moderngl"),
        "meniscus": meniscus.__version__,
        "load": round(load, 2),
        "warning": load_warning(load, cores),
    }


def usable_cores() -> int:
    """Of this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load_warning(load: float, cores: int) -> str:
    """A sentence where others use the machine, else nothing."""
    if load <= BUSY * cores:
        return ""
    return f"The machine was busy before the run (load {load:.2f} on {cores} cores): do not trust these times."


def _cpu_info(*keys: str) -> str:
    """The first processor's entry in Linux's list."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    return next((line.partition(":")[2].strip() for line in lines if line.partition(":")[0].strip() in keys), "")
