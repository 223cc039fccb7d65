"""A finding in the peer's own calls: 20 lines at most, needing the peer and numpy alone, for its issue tracker.

Each prints what the peer answers beside what is true, and asks exactly what the protocol's peer asks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from collide import distance
from collide.adapters.fuzzing import library_snippets, pair_snippets, simulator_snippets
from collide.adapters.fuzzing.disagreements import WRONG_POINTS, Flaw
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.proofs import expected_text
from collide.adapters.fuzzing.snippet_parts import Asked, n_rows
from collide.errors import CollideError

MAX_LINES = 20
#: Points and facets above which a snippet would not be read.
MAX_ROWS = 120
#: Engines that have a form here.
FORMS: dict[str, Callable[[Asked], list[str]]] = {
    "fcl": library_snippets.fcl_lines, "coal": library_snippets.coal_lines, "trimesh": library_snippets.trimesh_lines,
    "pybullet": simulator_snippets.pybullet_lines, "mujoco": simulator_snippets.mujoco_lines,
    "drake": simulator_snippets.drake_lines, "rapier": simulator_snippets.rapier_lines,
    "distance3d": pair_snippets.distance3d_lines, "newton": pair_snippets.newton_lines,
    "cgal": pair_snippets.cgal_lines,
}


def snippet(flaw: Flaw, case: Case, known: dict[str, Any]) -> str | None:
    """Python for one finding; None for engines without a form here, Worlds, and shapes of too many numbers.

    known : as `proofs.proof` gives it.
    """
    name, _, setting = flaw.engine.partition(":")
    if name not in FORMS or case.world or any(n_rows(body.shape) > MAX_ROWS for body in case.bodies[:2]):
        return None
    points = flaw.kind == WRONG_POINTS
    expected = expected_text(known) + (f"; nearest points {_nearest_points(case)}" if points else "")
    try:
        lines = FORMS[name](Asked(case, setting, expected, points))
    except (CollideError, KeyError):
        return None  # a shape that the peer cannot be given
    assert len(lines) <= MAX_LINES, lines
    return "\n".join(lines) + "\n"


def _nearest_points(case: Case) -> str:
    """Those that collide finds; of parallel faces there are others."""
    r = distance(*case.pair())
    return f"for example {np.asarray(r.point_a).tolist()} on A, {np.asarray(r.point_b).tolist()} on B"
