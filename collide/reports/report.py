"""The collision report as plain data: classes of pairs, skipped pairs, proofs of the answers.

`make` asks a scene's World a single question and sorts the rows into the classes of `reports/classes.py`.
`Report.to_dict` is the JSON of ``schema.json`` (docs/report-schema.md explains it).
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

import collide
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.kernels import mode
from collide.reports import classes, overlap_volumes, proofs
from collide.reports import mesh_notes as meshes
from collide.reports.number_format import brief_length, count
from collide.reports.pair_classes import Pairs
from collide.reports.progress import silent

SCHEMA = "collide-report/4"

#: Why a pair that cannot be answered is not tested.
UNANSWERED = "cannot be answered"


@dataclass
class Report:
    """The result of `make`: plain data, and the classes of pairs, made plain data on access.

    bodies : their names, in the order of the scene.
    geometry, trajectory : results of `geometry.of_scene` and `trajectory.follow`, where asked for.
    """

    scene: dict
    query: dict
    pairs: dict
    colliding: Pairs
    shallow: Pairs
    touching: Pairs
    near: Pairs
    meshes: list[dict]
    approximations: list[dict]
    unanswered: list[dict]
    skipped: list[dict]
    overlaps: list[dict]
    proofs: list[dict]
    work: dict
    notes: list[str] = field(default_factory=list)
    missing_meshes: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    versions: dict[str, str | None] = field(default_factory=dict)
    bodies: list[str] = field(default_factory=list)
    geometry: dict | None = None
    trajectory: dict | None = None

    @property
    def collides(self) -> bool:
        """True where at least one pair collides, counting neither shallow nor touching pairs."""
        return bool(self.colliding)

    @property
    def asks(self) -> list[str]:
        """Notes that ask whether the input is as meant: units of meshes, degrees for radians, a robot without SRDF."""
        return [note for note in dict.fromkeys(self.notes) if "?" in note]

    def verdict(self) -> str:
        """The report in one line."""
        clearance = self.query["clearance"]
        parts = [count(len(self.colliding), "collision") if self.colliding else "no collision"]
        if self.shallow:
            parts.append(f"{len(self.shallow)} shallower than {brief_length(self.query['min_depth'])}")
        if self.touching:
            parts.append(f"{len(self.touching)} touching")
        if clearance > 0:
            parts.append(f"{len(self.near) or 'none'} within {brief_length(clearance)}")
        if self.unanswered:
            parts.append(f"{count(len(self.unanswered), 'pair')} NOT ANSWERED")
        if self.query["ignored"]:
            parts.append(f"{len(self.query['ignored'])} ignored")
        if self.missing_meshes:
            parts.append(f"{count(len(self.missing_meshes), 'mesh', 'meshes')} missing, NOT CHECKED")
        excluded, total = self.pairs["excluded"], self.pairs["total"]
        pairs = count(total, "pair")
        parts.append(
            "no pair to test" if not total
            else f"{excluded} of {pairs} never tested" if excluded
            else f"all {pairs} answered" if total > 1
            else "1 pair answered"
        )
        return ", ".join(parts)

    def items(self) -> Iterator[tuple[str, object]]:
        """The JSON that ``schema.json`` describes, key by key, with the classes of pairs as `Pairs`."""
        by_class = {name: getattr(self, name) for name in classes.NAMES}
        yield "schema", SCHEMA
        yield "verdict", {
            "text": self.verdict(), "collides": self.collides, **{name: len(pairs) for name, pairs in by_class.items()},
        }
        yield from ((name, getattr(self, name)) for name in ("scene", "query", "pairs"))
        yield from by_class.items()
        yield from (
            (name, getattr(self, name))
            for name in (
                "overlaps", "meshes", "approximations", "unanswered", "skipped", "proofs", "work", "notes",
                "missing_meshes", "seconds", "versions",
            )
        )
        asked = {"trajectory": self.trajectory, "geometry": self.geometry}
        yield from ((name, value) for name, value in asked.items() if value is not None)

    def to_dict(self) -> dict:
        """The report as JSON-ready data that ``schema.json`` describes: no NaN, no infinity."""
        return {name: list(value.dicts()) if isinstance(value, Pairs) else value for name, value in self.items()}


def make(
    scene, clearance: float = 0.0, min_depth: float = 0.0, progress=None, started: float | None = None,
    ignore: Iterable[tuple[str, str]] = (), depth: Literal["quick", "least"] = "quick",
) -> Report:
    """Test a scene and sort what was found.

    Parameters
    ----------
    scene : `collide.scenes.Scene`.
    clearance : pairs nearer than this [m] are reported too; ≥ 0.
    min_depth : collisions proven less deep than this [m] are a class of their own; ≥ 0.
    progress : called with a label, gives a context manager around long work (`progress.Progress`).
    started : ``time.perf_counter()`` when the user's command began; the total counts from there.
    ignore : pairs of bodies, by name, that are not tested: the report says so.
    depth : "least" to search the shortest way out of overlapping unions and solids, as of `collide.distance`.

    Raises
    ------
    InvalidArgument : clearance or min_depth is negative or not finite; a body to ignore is not in the scene.
    CollideError : whatever the World refuses.
    """
    clearance, min_depth = checks.length("clearance", clearance), checks.length("min_depth", min_depth)
    ignored = [_known_pair(scene, pair) for pair in ignore]
    if ignored:
        scene = without(scene, ignored)
    start = time.perf_counter()
    with (progress or silent)("testing the scene"):
        sizes = classes.body_sizes(scene.bodies)
        limit = max(clearance, float(classes.roundings(sizes, 0.0).max(initial=0.0)))
        world, result, unanswered = _ask(scene, limit, depth)
    tested = time.perf_counter()
    stats = world.stats
    names = world.names
    size = np.zeros(max(names, default=-1) + 1)
    size[list(names)] = sizes
    rounding = classes.roundings(size[result.rows["a"]], size[result.rows["b"]])
    approximated = frozenset(body.name for body in scene.bodies if body.approximation)
    by_class = {
        name: Pairs.of(result, indices, names, approximated)
        for name, indices in classes.classify(result.rows, rounding, clearance=clearance, min_depth=min_depth).items()
    }
    report = Report(
        scene=_scene(scene),
        query={
            "clearance": clearance, "min_depth": min_depth, "depth": depth, "ignored": [list(pair) for pair in ignored]
        },
        pairs=_pairs(stats),
        colliding=by_class[classes.COLLIDING],
        shallow=by_class[classes.SHALLOW],
        touching=by_class[classes.TOUCHING].by_name(),
        near=by_class[classes.NEAR],
        meshes=meshes.of_scene(scene),
        approximations=_approximations(scene),
        unanswered=unanswered,
        skipped=_skipped(stats),
        overlaps=overlap_volumes.of_pairs(scene, by_class[classes.COLLIDING], by_class[classes.SHALLOW]),
        proofs=_proofs(stats),
        work=_work(stats),
        notes=[str(note) for note in scene.notes],
        missing_meshes=[entry for robot in scene.robots.values() for entry in robot.missing_meshes],
        versions=versions(),
        bodies=[body.name for body in scene.bodies],
    )
    report.notes += _robots_without_srdf(scene, report.colliding)
    report.seconds = _seconds(scene, stats, start, tested, started)
    return report


def _robots_without_srdf(scene, colliding: Pairs) -> list[str]:
    """A note for each robot whose own links collide, and of which no file says what links never meet."""
    unsaid = {
        name: placement.carried for name, placement in scene.placements.items()
        if placement.robot.semantic_pairs is None
    }
    counts = dict.fromkeys(unsaid, 0)
    for pair in colliding if unsaid else ():
        for name, carried in unsaid.items():
            counts[name] += pair.a in carried and pair.b in carried
    return [
        f"robot {name} has no SRDF, and {count(n, 'pair')} of its links collide: can these ever be apart? "
        f"`collide srdf {_brief_path(scene.robots[name].sources)} --out {name}.srdf` proposes which need no test"
        for name, n in counts.items() if n
    ]


def _brief_path(sources) -> str:
    return os.path.relpath(sources[0]) if sources else "ROBOT"


def without(scene, pairs: Iterable[tuple[str, str]]):
    """The scene with these pairs of bodies never tested, ``ignored`` being the reason."""
    return replace(scene, allowed=[*scene.allowed, *((a, b, proofs.IGNORED) for a, b in pairs)])


def _known_pair(scene, pair) -> tuple[str, str]:
    a, b = pair
    for name in (a, b):
        scene.body(name)
    if a == b:
        raise InvalidArgument(f"ignore: {a!r} twice; a body is never tested against itself")
    return a, b


def _ask(scene, limit: float, depth: Literal["quick", "least"]):
    """(world, its distances up to a limit [m], near pairs without an answer as data)."""
    world = scene.world()
    try:
        return world, world.distances(max_distance=limit, depth=depth), []
    except UnsupportedQuery:
        refused = world.unanswerable(max_distance=limit)
        if not refused:
            raise
    for a, b, _ in refused:
        world.allow(a, b, reason=UNANSWERED)
    names = world.names
    unanswered = [{"a": names[a], "b": names[b], "why": why} for a, b, why in refused]
    return world, world.distances(max_distance=limit, depth=depth), unanswered


# --- everything around the pairs ----------------------------------------------------------------


def _scene(scene) -> dict:
    return {
        "name": scene.name,
        "sources": [str(source) for source in scene.sources],
        "bodies": len(scene.bodies),
        "static": sum(bool(body.static) for body in scene.bodies),
        "robots": sorted(scene.robots),
    }


def _approximations(scene) -> list[dict]:
    return [
        {"body": body.name, "what": body.approximation, "shape": type(body.shape).__name__, "source": body.source}
        for body in scene.bodies
        if body.approximation
    ]


def _pairs(stats: dict) -> dict:
    skipped = {reason: int(n) for reason, n in stats["skipped"].items()}
    apart = skipped.pop(proofs.BROADPHASE, 0)
    return {
        "total": int(stats["pairs"]),
        "excluded": sum(skipped.values()),
        "apart_by_boxes": apart,
        "tested": int(stats["narrowphase"]),
    }


def _skipped(stats: dict) -> list[dict]:
    """Reasons with their counts, most pairs first; the broadphase is a proof and stands in `_proofs`."""
    reasons = [(reason, int(n)) for reason, n in stats["skipped"].items() if n and reason != proofs.BROADPHASE]
    reasons.sort(key=lambda item: (-item[1], item[0]))
    return [{"reason": r, "pairs": n, "meaning": proofs.REASONS.get(r)} for r, n in reasons]


def _proofs(stats: dict) -> list[dict]:
    counts = {how: int(n) for how, n in stats["how"].items()}
    counts[proofs.BROADPHASE] = int(stats["skipped"].get(proofs.BROADPHASE, 0))
    ordered = sorted(((how, n) for how, n in counts.items() if n), key=lambda item: (-item[1], item[0]))
    return [{"how": how, "pairs": n, "sentence": proofs.SENTENCES.get(how, how)} for how, n in ordered]


def _work(stats: dict) -> dict:
    """Counts for diagnosis, as far as the engine keeps them."""
    counters = ("convex_pairs", "gjk_iterations", "epa_iterations")
    return {name: int(stats[name]) for name in counters if name in stats}


def _seconds(scene, stats: dict, start: float, tested: float, started: float | None) -> dict[str, float]:
    """Stage → seconds. ``other`` is what no stage claims: start-up, imports, building the World."""
    stages = {name: float(s) for name, s in scene.seconds.items()}
    loading = sum(stages.values())
    for name, s in stats["seconds"].items():
        stages[name] = stages.get(name, 0.0) + float(s)
    now = time.perf_counter()
    stages["report"] = now - tested
    total = now - started if started is not None else loading + now - start
    stages["other"] = max(0.0, total - sum(stages.values()))
    stages["total"] = total
    return stages


def versions() -> dict[str, str | None]:
    """What gave the answer; None for a package whose version cannot be told."""
    return {
        "collide": collide.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "kernels": mode.describe_mode(),
        "machine": platform.machine() or None,
    }
