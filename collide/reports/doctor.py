"""Is this installation sound? Versions, caches, and pairs whose answers are known.

Asks the public interface like any user would; what fails is shown, never raised.
"""

from __future__ import annotations

import os
import platform
import sys
import tempfile
from dataclasses import dataclass, field
from importlib import import_module, metadata
from pathlib import Path

import collide
from collide.base.cache_folder import cache_folder, why_distrusted
from collide.kernels import library, mode
from collide.reports.number_format import count, widths
from collide.reports.progress import silent
from collide.reports.report import versions
from collide.reports.tables import Column, Table

#: (distribution, extra with the distribution, purpose)
OPTIONAL = (
    ("pyyaml", "robots", "scene files, joint states, planning scenes"),
    ("trimesh", "robots", "mesh files"),
    ("yourdfpy", "robots", "checking URDF against a second reader"),
    ("scipy", "robots", "hulls of mesh vertices"),
    ("rich", "robots", "colours in the terminal"),
    ("example-robot-data", "demo", "the panda of the shipped scene"),
    ("numba", "jit", "changing kernels: COLLIDE_JIT=1"),
    ("coacd", "decompose", "meshes as unions of convex pieces"),
    ("matplotlib", "plots", "collide locality --plot"),
    ("pyarrow", "sweep", "collide sweep"),
    ("distributed", "sweep", "collide sweep --scheduler"),
    ("mujoco", "mujoco", "MJCF models; MuJoCo's steps with collide's contacts"),
    ("coal", "peers", "collide compare"),
    ("python-fcl", "peers", "collide compare"),
    ("pybullet", "peers", "collide compare (wheels up to Python 3.11)"),
)


@dataclass
class Check:
    """A finding: ``passed`` is ``False`` for a broken part, ``None`` for a remark."""

    what: str
    answer: str
    passed: bool | None = True


@dataclass
class Examination:
    """Everything `examine` found."""

    installed: list[Check] = field(default_factory=list)
    optional: list[Check] = field(default_factory=list)
    hosts: list[Check] = field(default_factory=list)
    caches: list[Check] = field(default_factory=list)
    answers: list[Check] = field(default_factory=list)

    @property
    def sound(self) -> bool:
        """True where nothing is broken."""
        return all(check.passed is not False for check in self._all())

    def _all(self) -> list[Check]:
        return [*self.installed, *self.optional, *self.hosts, *self.caches, *self.answers]

    def verdict(self) -> str:
        """The examination in one line."""
        broken = [check.what for check in self._all() if check.passed is False]
        names = ", ".join(broken[:3]) + (", …" if len(broken) > 3 else "")
        return f"BROKEN: {count(len(broken), 'finding')}: {names}" if broken else "sound"

    def tables(self) -> list[Table]:
        """One table a chapter."""
        return [
            _table("INSTALLED", self.installed),
            _table("OPTIONAL  pip install 'collide-robotics[EXTRA]'", self.optional),
            _table("HOSTS  programs of other engines that run on collide", self.hosts),
            _table("KEPT BETWEEN RUNS", self.caches),
            _table("SELF-CHECK  pairs with known answers", self.answers),
        ]


_WORDS = {True: "ok", False: "BROKEN", None: "-"}


def _table(title: str, checks: list[Check]) -> Table:
    columns = [Column("", "label"), Column("", "label"), Column("", "text")]
    return Table(title, columns, [[_WORDS[check.passed], check.what, check.answer] for check in checks])


def examine(progress=None) -> Examination:
    """Look at the installation and ask the known pairs.

    progress : called with a label, gives a context manager around long work.
    """
    with (progress or silent)("asking pairs with known answers"):
        answers = _answers()
    with (progress or silent)("asking hosts whether their hooks hold"):
        hosts = _hosts()
    return Examination(_installed(), _optional(), hosts, _caches(), answers)


def _installed() -> list[Check]:
    known = versions()
    python = f"{platform.python_version()} ({sys.executable})"
    checks = [
        Check("collide", str(known["collide"])),
        Check("Python", python, sys.version_info >= (3, 10)),
    ]
    checks += [Check("numpy", known["numpy"] or "missing", known["numpy"] is not None), *_kernels()]
    machine = f"{platform.system()} {known['machine']}, {count(os.cpu_count() or 1, 'processor')}"
    return [*checks, Check("machine", machine)]


def _kernels() -> list[Check]:
    """How kernels run here, and what of."""
    about = library.about()
    if mode.MODE == mode.COMPILED:
        checks = [Check("kernels", f"compiled, level {about['level']} of {about['levels']}")]
    else:
        numba = (
            f" (numba {package_version('numba')}, kept on disk)" if mode.MODE == mode.JUST_IN_TIME else ", very slow"
        )
        state = "NO COMPILED KERNELS" if not about else "FALLING BACK"
        checks = [Check("kernels", f"{state}: run {mode.MODE}{numba}: {mode.WHY}", None)]
    if about:
        checks += [
            Check("library", f"{about['path']}"),
            Check("built by", f"{about['compiler']}, from sources {about['sources']}"),
        ]
    return checks


def package_version(package: str) -> str | None:
    """The installed version of a distribution, without importing the package; ``None`` if not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _optional() -> list[Check]:
    return [
        Check(name, f"{version} ({purpose})", True) if version else Check(name, f"absent: {purpose} [{extra}]", None)
        for name, extra, purpose in OPTIONAL
        for version in [package_version(name)]
    ]


def _hosts() -> list[Check]:
    """Modules that stand in for other engines: beside what version, and whether their hooks hold."""
    hosts, host_checks = (import_module(f"collide.adapters.{name}") for name in ("hosts", "hosts.host_checks"))
    checks = []
    for host, finding in zip(hosts.HOSTS, host_checks.check_hosts(hosts.HOSTS)):
        absent = "absent" if host.is_needed else "not installed, and not needed"
        state = f"{host.package} {finding.version or absent}"
        checks.append(Check(host.name, f"{host.module}: {finding.answer}; {host.usage} ({state})", finding.passed))
    return checks


def _caches() -> list[Check]:
    kernels = _kept_kernels() if mode.MODE == mode.JUST_IN_TIME else []
    return [*kernels, _cache("prepared inputs", cache_folder("scenes"))]


def _kept_kernels() -> list[Check]:
    """Of kernels compiled just in time."""
    folder = cache_folder("kernels")
    try:
        why = why_distrusted(folder)
    except OSError:  # told below
        why = None
    if why is not None:
        return [
            Check(
                "kernels",
                f"{folder} is not used, for kernels are code: {why}: compiled anew in every run; set COLLIDE_CACHE_DIR",
                None,
            )
        ]
    return [
        _cache("kernels", folder),
        Check("kernels are code", "who can write in their folder decides what runs: only its user may"),
    ]


def _cache(what: str, folder: Path) -> Check:
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    try:
        with tempfile.TemporaryFile(dir=existing):  # asking for permission says yes to root, writing may still fail
            pass
    except OSError:
        return Check(what, f"{folder} cannot be written: made anew in every run; set COLLIDE_CACHE_DIR", None)
    files = [file for file in folder.rglob("*") if file.is_file()]
    megabytes = sum(file.stat().st_size for file in files) / 1e6
    return Check(what, f"{folder} ({count(len(files), 'file')}, {megabytes:.1f} MB)")


# --- known answers ------------------------------------------------------------------------------


def _answers() -> list[Check]:
    """Each pair's bracket must hold the number geometry gives, and its boolean must agree."""
    checks = []
    for what, A, B, x, truth in _known_pairs():
        try:
            checks.append(_ask(what, A, B, x, truth))
        except Exception as error:  # noqa: BLE001 - a doctor reports what is broken, whatever broke
            checks.append(Check(what, f"{type(error).__name__}: {error}", False))
    return checks


def _known_pairs():
    """(name, A, B, where B stands along x [m], true signed distance [m])."""
    box, sphere = collide.Box((1.0, 1.0, 1.0)), collide.Sphere(0.5)
    hull = collide.ConvexHull([(0, 0, 0), (1, 0.5, 0), (1, 0, 0.5), (1, 0.5, 0.5)])
    yield "two spheres apart", sphere, sphere, 3.0, 2.0
    yield "two boxes apart", box, box, 1.5, 0.5
    yield "two boxes overlapping", box, box, 0.75, -0.25
    yield "box and sphere touching", box, sphere, 1.0, 0.0
    yield "capsule and hull apart", collide.Capsule(0.25, 1.0), hull, 0.5, 0.25
    yield "cylinder and box overlapping", collide.Cylinder(0.5, 2.0), box, 0.75, -0.25
    yield "half-space and sphere apart", collide.Halfspace((1.0, 0.0, 0.0), 0.0), sphere, 1.5, 1.0


def _ask(what: str, A, B, x: float, truth: float) -> Check:
    X_WB = collide.pose((x, 0.0, 0.0))
    r = collide.distance(A, B, collide.pose(), X_WB)
    hit = collide.collide(A, B, collide.pose(), X_WB)
    held = r.lower <= truth <= r.upper and bool(hit) == bool(r.hit) == (truth <= 0)
    answer = f"{r.distance:.12g} m, known to {widths([r.upper - r.lower])[0]}"
    return Check(what, answer if held else f"{answer}: [{r.lower!r}, {r.upper!r}] should hold {truth!r}", held)
