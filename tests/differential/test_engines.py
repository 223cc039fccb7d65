"""Every installed engine asked the hard families and the published cases: ours is never wrong, others are counted.

Answers are judged in exact arithmetic. Wrong booleans are counted twice: all of them, and those of pairs farther than
1e-12 of their size from touching. Rows are printed as Markdown (-s), the tables of docs/engines.md; engines whose
packages are absent are left out, the published cases where ../shared is. COLLIDE_ENGINES=coal,fcl names engines.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from samples import sizes

from collide import Box, Capsule, ConvexHull, Cylinder, Ellipsoid
from collide.adapters.peers.answers import counted
from collide.adapters.peers.protocol import Question, engine, installed
from collide.adapters.peers.stress import HIT, run
from collide.scenes.families import mesh_names, names

PUBLISHED = Path(__file__).resolve().parents[3] / "shared" / "data" / "cases" / "published_cases.json"
#: Pairs nearer to touching than this part of their size are counted apart; distances off by more are wrong.
TOUCHING, WRONG = 1e-12, 1e-6

MAKERS = {
    "box": lambda d: Box(d["size"]), "convex": lambda d: ConvexHull(d["vertices"]),
    "sphere": lambda d: ConvexHull([(0, 0, 0)], radius=d["radius"]),  # some have radius 0
    "capsule": lambda d: Capsule(d["radius"], d["length"]), "cylinder": lambda d: Cylinder(d["radius"], d["length"]),
    "ellipsoid": lambda d: Ellipsoid(d["radii"]),
}


def engines(alone: bool) -> list[str]:
    """collide alone in the normal suite, else all that are named or installed, ours first."""
    if alone:
        return ["collide"]
    named = os.environ.get("COLLIDE_ENGINES", "")
    return named.split(",") if named else [name for name in installed() if name != "exact"]


def show(row: dict) -> None:
    """A line of a Markdown table."""
    cells = (f"{v:.0e}" if isinstance(v, float) else "-" if v is None else str(v) for v in row.values())
    print(f"| {' | '.join(cells)} |", flush=True)


@sizes(1, 10)
def test_ours_has_no_wrong_boolean_in_the_hard_families(n):
    """n cases a family."""
    for name in engines(n == 1):
        for group, members in (("convex", names()), ("meshes", mesh_names())):
            asked = members[::4] if n == 1 else members
            table = run(asked, n=n, seed=1, engine=name, timeout=5.0)
            total, wrong = table.total(), [finding for finding in table.findings if finding.kind == HIT]
            worst = Counter(f.family for f in wrong if f.gap > TOUCHING).most_common(3)
            show({
                "engine": name, "version": table.version, "families": group, "cases": total.cases,
                "not asked": total.unsupported, "wrong": total.wrong, "false hits": total.false_hits,
                "missed hits": total.false_misses, "wrong, not touching": sum(f.gap > TOUCHING for f in wrong),
                "farthest": max((f.gap for f in wrong), default=0.0), "undecided": total.undecided,
                "mishaps": counted(total.mishaps), "gap off by": total.distance_error_of_size,
                "depth off by": total.depth_error_of_size, "most in": ", ".join(f"{f} {k}" for f, k in worst),
            })
            assert total.cases >= len(asked)
            assert name != "collide" or not (total.wrong or total.mishaps), [finding.snippet for finding in wrong]


@pytest.mark.skipif(not PUBLISHED.exists(), reason="the published cases are not beside this checkout")
@sizes(1, 10)
def test_ours_is_right_about_the_published_cases(n):
    """Of all pairs (n is not asked), against their references, some of which are good to 1e-8."""
    records = json.loads(PUBLISHED.read_text())
    sides = [[MAKERS[r[side]["type"]](r[side]) for side in "ab"] for r in records]
    question = Question.from_pairs([(*s, np.array(r["Ta"]), np.array(r["Tb"])) for s, r in zip(sides, records)])
    truth, size = np.array([r["ref"] for r in records]), np.array(question.sizes())
    gap = np.abs(truth) > 1e-7 * size
    for name in engines(n == 1):
        table = engine(name, timeout=5.0).answer(question)
        answered, with_distance = table.rows["answered"], table.rows["has_distance"]
        wrong = answered & gap & (table.rows["hit"] != (truth <= 0))
        off = np.where(with_distance, np.abs(table.rows["distance"] - truth) / size, 0.0)
        show({
            "engine": name, "version": table.version, "cases": len(records), "answered": int(answered.sum()),
            "wrong booleans, clear of touching": int(wrong.sum()), "of": int((answered & gap).sum()),
            "wrong distances": int((off > WRONG).sum()), "with a distance": int(with_distance.sum()),
            "off by at most": float(off.max()), "mishaps": counted(Counter(filter(None, table.mishaps))),
            "worst": records[int(off.argmax())]["id"] if off.max() > WRONG else "",
        })
        ours_wrong = [records[k]["id"] for k in np.flatnonzero(wrong | (off > WRONG))]
        assert name != "collide" or not ours_wrong, ours_wrong
    assert len(records) > 100
