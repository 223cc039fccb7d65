"""What timings depend on: processor, cores, system, versions, load. The machine's name is not kept."""

from __future__ import annotations

import csv
import io
import os
import platform
import re
from importlib import metadata
from pathlib import Path

from collide.base.whole_file import write_whole
from collide.errors import CollideError


def machine_stamp() -> dict[str, str]:
    """cpu, cores, load (of the last minute, as the measurement began), system, python, numpy, collide."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "cpu": _cpu(), "cores": str(cores), "load": _load(), "system": platform.system(),
        "python": platform.python_version(), "numpy": metadata.version("numpy"), "collide": _collide(),
    }


def _cpu() -> str:
    try:
        models = re.findall(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), flags=re.MULTILINE)
    except OSError:
        models = []
    return models[0] if models else platform.processor() or platform.machine()


def _load() -> str:
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""


def _collide() -> str:
    try:
        return metadata.version("collide-robotics")
    except metadata.PackageNotFoundError:
        return "unknown"


def file_name(name: str, stamp: dict[str, str]) -> str:
    """Of a CSV: with the kind of machine, so that a later run on it takes its place; without a stamp the name alone."""
    if not stamp:
        return f"{name}.csv"
    cpu = re.sub(r"[^a-z0-9]+", "-", stamp["cpu"].lower()).strip("-")
    return f"{name}_{cpu}_{stamp['cores']}-cores.csv"


def write_csv(place: Path, rows: list[dict], stamp: dict[str, str]) -> None:
    """Rows with the same keys, each followed by the stamp; a file that exists is overwritten."""
    if not rows:
        raise CollideError(f"{place.name}: there is nothing to write down: no engine was asked")
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, [*rows[0], *stamp], lineterminator="\n")
    writer.writeheader()
    writer.writerows({**row, **stamp} for row in rows)
    write_whole(place, text.getvalue())
