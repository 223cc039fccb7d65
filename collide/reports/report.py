"""The collision report as plain data: classes of pairs, what was skipped, why each answer holds.

`make` asks a scene's World one question and sorts the rows. The classes, with
lower ≤ signed distance ≤ upper proven for every row:

========== ================================================================================
colliding  the bodies share a point: proven
shallow    colliding, but proven less deep than ``min_depth``: −lower < min_depth
touching   touching within rounding: doubles leave the sign open, and exact arithmetic has
           settled it where it can; with meshes: gap or overlap below rounding
near       apart, and 0 < distance ≤ clearance
========== ================================================================================

`Report.to_dict` is the JSON of ``schema.json`` (docs/report-schema.md explains it).
"""

from __future__ import annotations

import math
import platform
import time
from dataclasses import asdict, dataclass, field
from importlib import metadata

from collide.errors import InvalidArgument, UnsupportedQuery
from collide.reports import meshes, proofs
from collide.reports.progress import silent
from collide.reports.units import brief_length, count
from collide.results import UNDECIDED

SCHEMA = "collide-report/2"

#: Why a pair that cannot be answered is not tested.
UNANSWERED = "cannot be answered"


@dataclass(frozen=True)
class Pair:
    """One pair of bodies; lengths in metres, vectors in the world frame.

    ``distance`` is signed, ``depth`` its positive part (None where apart). ``normal`` points from
    a to b. ``approximated`` lists which of the two bodies are not the shape the scene names.
    """

    a: str
    b: str
    distance: float | None
    depth: float | None
    lower: float | None
    upper: float | None
    normal: list[float]
    point_a: list[float]
    point_b: list[float]
    part_a: int
    part_b: int
    how: str
    certified: bool
    approximated: list[str]

    @property
    def decided(self) -> bool:
        """Whether the sign is proven."""
        return self.how != proofs.UNDECIDED_NAME


@dataclass
class Report:
    """What `make` found; every field is plain data, ready for JSON."""

    scene: dict
    query: dict
    pairs: dict
    colliding: list[Pair]
    shallow: list[Pair]
    touching: list[Pair]
    near: list[Pair]
    meshes: list[dict]
    approximations: list[dict]
    unanswered: list[dict]
    skipped: list[dict]
    proofs: list[dict]
    work: dict
    notes: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    versions: dict[str, str | None] = field(default_factory=dict)

    @property
    def collides(self) -> bool:
        """True where at least one pair collides, counting neither shallow nor touching pairs."""
        return bool(self.colliding)

    def verdict(self) -> str:
        """The report in one line."""
        clearance = self.query["clearance"]
        parts = [count(len(self.colliding), "collision") if self.colliding else "no collision"]
        if self.shallow:
            parts.append(f"{len(self.shallow)} shallower than {brief_length(self.query['min_depth'])}")
        if self.touching:
            parts.append(f"{len(self.touching)} touching within rounding")
        if clearance > 0:
            parts.append(f"{len(self.near) or 'none'} within {brief_length(clearance)}")
        if self.unanswered:
            parts.append(f"{count(len(self.unanswered), 'pair')} NOT ANSWERED")
        excluded, total = self.pairs["excluded"], self.pairs["total"]
        pairs = count(total, "pair")
        parts.append(
            "no pair to test" if not total
            else f"{excluded} of {pairs} never tested" if excluded
            else f"all {pairs} answered" if total > 1
            else "1 pair answered"
        )
        return ", ".join(parts)

    def to_dict(self) -> dict:
        """The report as JSON-ready data that ``schema.json`` describes: no NaN, no infinity."""
        classes = {
            name: [asdict(pair) for pair in getattr(self, name)]
            for name in ("colliding", "shallow", "touching", "near")
        }
        return {
            "schema": SCHEMA,
            "verdict": {
                "text": self.verdict(),
                "collides": self.collides,
                **{name: len(pairs) for name, pairs in classes.items()},
            },
            "scene": self.scene,
            "query": self.query,
            "pairs": self.pairs,
            **classes,
            "meshes": self.meshes,
            "approximations": self.approximations,
            "unanswered": self.unanswered,
            "skipped": self.skipped,
            "proofs": self.proofs,
            "work": self.work,
            "notes": self.notes,
            "seconds": self.seconds,
            "versions": self.versions,
        }


def make(scene, clearance: float = 0.0, min_depth: float = 0.0, progress=None, started: float | None = None) -> Report:
    """Test a scene and sort what was found.

    Parameters
    ----------
    scene : `collide.scenes.Scene`.
    clearance : pairs nearer than this [m] are reported too; ≥ 0.
    min_depth : collisions proven less deep than this [m] are a class of their own; ≥ 0.
    progress : called with a label, gives a context manager around long work (`progress.Progress`).
    started : ``time.perf_counter()`` when the user's command began; the total counts from there.

    Raises
    ------
    InvalidArgument : clearance or min_depth is negative or not finite.
    CollideError : whatever the World refuses.
    """
    clearance, min_depth = _length("clearance", clearance), _length("min_depth", min_depth)
    begun = time.perf_counter()
    with (progress or silent)("testing the scene"):
        world, result, unanswered = _ask(scene, max(clearance, _rounding_of(scene)))
    tested = time.perf_counter()
    stats = world.stats
    classes = _classes(result, scene, clearance, min_depth)
    report = Report(
        scene=_scene(scene),
        query={"clearance": clearance, "min_depth": min_depth},
        pairs=_pairs(stats),
        colliding=classes["colliding"],
        shallow=classes["shallow"],
        touching=classes["touching"],
        near=classes["near"],
        meshes=meshes.of_scene(scene),
        approximations=_approximations(scene),
        unanswered=unanswered,
        skipped=_skipped(stats),
        proofs=_proofs(stats),
        work=_work(stats),
        notes=[str(note) for note in scene.notes],
        versions=versions(),
    )
    report.seconds = _seconds(scene, stats, begun, tested, started)
    return report


def _ask(scene, limit: float):
    """(world, its distances up to a limit [m], pairs near each other that it cannot answer, as data)."""
    world = scene.world()
    try:
        return world, world.distances(max_distance=limit), []
    except UnsupportedQuery:
        refused = world.unanswerable(max_distance=limit)
        if not refused:
            raise
    for a, b, _ in refused:
        world.allow(a, b, reason=UNANSWERED)
    names = world.names
    told = [{"a": names[a], "b": names[b], "why": why} for a, b, why in refused]
    return world, world.distances(max_distance=limit), told


def _length(name: str, value: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InvalidArgument(f"{name} must be a number of metres, got {value!r}") from None
    if not (math.isfinite(number) and number >= 0):
        raise InvalidArgument(f"{name} must be finite and not negative [m], got {value!r}")
    return number


# --- pairs --------------------------------------------------------------------------------------


def _rounding_of(scene) -> float:
    """A distance [m] below which pairs of this scene may touch within rounding: 2⁻⁴⁰ of its size."""
    size = 0.0
    for body in scene.bodies:
        reach = max((packed.reach + abs(X[:3, 3]).sum() for packed, X in body.shape.bounding_parts()), default=0.0)
        size = max(size, float(abs(body.X_WB[:3, 3]).max()) + float(reach))
    return size * 2.0**-40


def _classes(result, scene, clearance: float, min_depth: float) -> dict[str, list[Pair]]:
    """The rows of a World result, each in its class, in the order people read them."""
    approximated = {body.name for body in scene.bodies if body.approximation}
    meshed = {body.name for body in scene.bodies if meshes.is_meshed(body.shape)}
    rounding = _rounding_of(scene) if meshed else 0.0
    classes: dict[str, list[Pair]] = {"colliding": [], "shallow": [], "touching": [], "near": []}
    for row, (a, b) in zip(result.rows, result.names):
        kind = _class_of(row, min_depth, rounding if a in meshed or b in meshed else None)
        if not row["beyond"] and (kind != "near" or row["distance"] <= clearance):
            classes[kind].append(_pair(row, a, b, approximated))
    classes["colliding"].sort(key=_deepest_first)
    classes["shallow"].sort(key=_deepest_first)
    classes["touching"].sort(key=lambda pair: (pair.a, pair.b))
    classes["near"].sort(key=lambda pair: (pair.distance, pair.a, pair.b))
    return classes


def _class_of(row, min_depth: float, rounding: float | None) -> str:
    """rounding : of pairs with a mesh, whose facets are tested exactly however deep the overlap: what is below it [m]."""
    below = proofs.is_below_rounding(int(row["how"]))
    if rounding is not None and row["how"] != UNDECIDED:
        below = max(-row["lower"], row["upper"]) <= rounding
    if below:
        return "touching"
    if not row["hit"]:
        return "near"
    # the depth is at most −lower: below min_depth only when that is proven
    return "shallow" if -row["lower"] < min_depth else "colliding"


def _deepest_first(pair: Pair) -> tuple:
    return (-math.inf if pair.depth is None else -pair.depth, pair.a, pair.b)


def _pair(row, a: str, b: str, approximated: set[str]) -> Pair:
    distance = _finite(row["distance"])
    hit = bool(row["hit"])
    return Pair(
        a=a, b=b,
        distance=distance,
        depth=None if not hit or distance is None else max(0.0, -distance),
        lower=_finite(row["lower"]), upper=_finite(row["upper"]),
        normal=_vector(row["normal"]), point_a=_vector(row["point_a"]), point_b=_vector(row["point_b"]),
        part_a=int(row["part_a"]), part_b=int(row["part_b"]),
        how=proofs.name_of(int(row["how"])),
        certified=bool(row["certified"]),
        approximated=[name for name in (a, b) if name in approximated],
    )


def _finite(value) -> float | None:
    """The number, −0.0 as 0.0; None where it is infinite (an unbounded depth or bracket)."""
    number = float(value) + 0.0
    return number if math.isfinite(number) else None


def _vector(values) -> list[float]:
    return [float(v) + 0.0 for v in values]


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
    kept = ("convex_pairs", "gjk_iterations", "epa_iterations")
    return {name: int(stats[name]) for name in kept if name in stats}


def _seconds(scene, stats: dict, begun: float, tested: float, started: float | None) -> dict[str, float]:
    """Stage → seconds. ``other`` is what no stage claims: start-up, imports, building the World."""
    stages = {name: float(s) for name, s in scene.seconds.items()}
    loading = sum(stages.values())
    for name, s in stats["seconds"].items():
        stages[name] = stages.get(name, 0.0) + float(s)
    now = time.perf_counter()
    stages["report"] = now - tested
    total = now - started if started is not None else loading + now - begun
    stages["other"] = max(0.0, total - sum(stages.values()))
    stages["total"] = total
    return stages


def versions() -> dict[str, str | None]:
    """What gave the answer; None for a package whose version cannot be told."""
    import collide

    return {
        "collide": collide.__version__,
        "python": platform.python_version(),
        "numpy": package_version("numpy"),
        "numba": package_version("numba"),
        "machine": platform.machine() or None,
    }


def package_version(package: str) -> str | None:
    """The installed version of a distribution, without importing it; None where there is none."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
