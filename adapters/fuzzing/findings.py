"""Findings in a folder: for each a scene file that `collide compare` takes, a snippet for the peer alone, an issue.

Two findings are duplicates where engine, kind of error, shapes and class of position are the same; the simpler is kept.
"""

from __future__ import annotations

import json
import platform
import re
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from collide.adapters.fuzzing import issue_text, peer_snippets
from collide.adapters.fuzzing.disagreements import Flaw
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.proofs import proof
from collide.adapters.fuzzing.simpler_cases import complexity
from collide.adapters.peers.protocol import engine
from collide.adapters.peers.question import Body
from collide.base.given_files import read_text
from collide.base.whole_file import write_whole
from collide.errors import SceneError
from collide.scenes import load
from collide.scenes.write_scene import document_text

#: What `collide compare` takes as the clearance by default [m].
CLEARANCE = 0.1
Kind = tuple[str, str, str, str, str]


class Finding(NamedTuple):
    """One wrong answer of an engine, shrunk.

    seed, round : where the fuzzer met it; None where it comes from a scene.
    times : how often it was met.   is_minimal : no simpler case errs in the same way.
    """

    case: Case
    flaw: Flaw
    seed: int | None = None
    round: int | None = None
    times: int = 1
    is_minimal: bool = True

    @property
    def kind(self) -> Kind:
        """Engine, kind of error, the two shapes, class of position: equal ones are duplicates."""
        return kind_of(self.case, self.flaw)

    @property
    def stem(self) -> str:
        """Its files' name."""
        words = "-".join(word for word in self.kind)
        return re.sub(r"[^a-z0-9]+", "-", words.lower()).strip("-")


def kind_of(case: Case, flaw: Flaw) -> Kind:
    """What makes two findings duplicates."""
    return flaw.engine, flaw.kind, *case.kinds, flaw.position


def save_finding(finding: Finding, folder: str | Path) -> Path:
    """Write a finding's files into a folder, which is made if need be; gives the scene file's path."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    place = folder / f"{finding.stem}.json"
    known = proof(finding.case)
    about = {
        "command": command(finding, place.name), "flaw": _plain_flaw(finding.flaw), "exact": known,
        "versions": versions(finding.flaw.engine), "seed": finding.seed, "round": finding.round,
        "times": finding.times, "minimal": finding.is_minimal,
    }
    snippet = peer_snippets.snippet(finding.flaw, finding.case, known)
    if snippet is not None:
        write_whole(folder / f"{finding.stem}.py", snippet)
    write_whole(folder / f"{finding.stem}.md", issue_text.issue(finding.flaw, finding.case, about, snippet))
    write_whole(place, document_text(finding.case.document(about, finding.stem)))
    return place


def load_finding(path: str | Path) -> tuple[Finding, dict[str, Any]]:
    """A finding from its scene file, and the file's ``about``: what was known when it was written.

    Raises SceneError for a file that is no finding.
    """
    about = json.loads(read_text(Path(path))).get("about")
    if not isinstance(about, dict) or "flaw" not in about:
        raise SceneError(f"{path}: this scene is no finding: its 'about' has no 'flaw'")
    scene = load(path)
    bodies = tuple(Body(b.name, b.shape, b.X_WB, b.static, b.group, b.mask) for b in scene.bodies)
    stored = {name: about["flaw"].get(name) for name in Flaw._fields}
    stored["severity"] = float("inf") if stored["severity"] is None else stored["severity"]
    flaw = Flaw(**stored)
    case = Case(bodies, world=flaw.engine == "collide" and len(bodies) > 2)
    place = about.get("seed"), about.get("round")
    return Finding(case, flaw, *place, about.get("times", 1), about.get("minimal", True)), about


def command(finding: Finding, name: str) -> str:
    """What reproduces a finding."""
    known = [x for x in (finding.flaw.exact_distance, finding.flaw.upper, finding.flaw.distance) if x is not None]
    farthest = max(known, default=0.0)
    clearance = f" --clearance {2 * farthest:.0f}" if farthest > CLEARANCE and 2 * farthest >= 1 else (
        " --clearance 1" if farthest > CLEARANCE else "")
    engines = "exact" if finding.flaw.engine == "collide" else finding.flaw.engine
    return f"collide compare {name} --engines {engines}{clearance}"


def versions(name: str) -> dict[str, str]:
    """Of the engine, collide, Python and the machine."""
    peer = engine(name, isolated=False)
    made = {peer.package or name: peer.version, "collide-robotics": engine("collide").version}
    made["numpy"] = metadata.version("numpy")
    return made | {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}


def simpler_of(a: Finding, b: Finding) -> Finding:
    """The one that is easier to read, counted together."""
    better = a if complexity(a.case) <= complexity(b.case) else b
    return better._replace(times=a.times + b.times)


def _plain_flaw(flaw: Flaw) -> dict[str, Any]:
    values = flaw._asdict()
    return values | {"severity": None if flaw.severity == float("inf") else flaw.severity}
