"""What is known of a pair, with the reason, as plain data: exact digits and a certificate, or a proven bracket."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np

from collide import distance
from collide.adapters.fuzzing.fuzz_case import Case, isolated
from collide.adapters.fuzzing.support_bounds import lower_bound
from collide.adapters.peers import exact
from collide.adapters.peers.exact_peer import ExactPeer, is_rounded
from collide.adapters.peers.question import corners
from collide.errors import CollideError
from collide.shapes import Halfspace

#: Digits of exact distances.
DIGITS = 20


def proof(case: Case) -> dict[str, Any]:
    """The answer to a case with its proof.

    ``hit``, ``distance`` (text, [m], negative: overlap; None where nobody knows it), ``lower`` and ``upper`` [m],
    ``by`` (how it is known) and ``certificate`` (numbers that anybody can check again; None where there are none).
    """
    bodies = case.bodies[:2]
    points = [None if isinstance(b.shape, Halfspace) else corners(b.shape) for b in bodies]
    if points[0] is not None and points[1] is not None and not is_rounded(*bodies):
        return _of_hulls(case, points[0], points[1])
    row = ExactPeer().answer(isolated([case])).rows[0]
    known: dict[str, Any] = {"hit": None, "distance": None, "lower": None, "upper": None, "by": "nothing"}
    known["certificate"] = None
    known |= _proven(case)
    if row["answered"]:
        known |= {"hit": bool(row["hit"]), "by": "exact arithmetic on integers"}
        if row["has_distance"] and not (row["hit"] and _n_answers(case)):
            known["distance"] = repr(float(row["distance"]))
    return known


def _n_answers(case: Case) -> bool:
    """True where a depth is that of parts, not of the whole."""
    return any(corners(body.shape) is None for body in case.bodies[:2])


def _of_hulls(case: Case, A: tuple[np.ndarray, float], B: tuple[np.ndarray, float]) -> dict[str, Any]:
    """Swept polytopes: the exact distance, and vertices with weights, an axis, or the nearest facet."""
    (points_a, radius_a), (points_b, radius_b) = A, B
    X_WA, X_WB = case.bodies[0].X_WB, case.bodies[1].X_WB
    pair = points_a, X_WA[:3, :3], X_WA[:3, 3], points_b, X_WB[:3, :3], X_WB[:3, 3]
    radii = {"radius_a": radius_a, "radius_b": radius_b}
    signed = exact.signed_distance(*pair, digits=DIGITS, **radii)
    answer: Any = exact.distance(*pair, digits=DIGITS)
    exact.verify(answer, *pair)
    certificate: dict[str, Any] = {
        "vertices": [[i, j, str(Fraction(w))] for i, j, w in answer.certificate.pairs],
        "axis": None if answer.certificate.axis is None else [str(x) for x in answer.certificate.axis],
        "radii": [radius_a, radius_b],
    }
    if answer.hit:
        depth = exact.depth(*pair, digits=DIGITS)
        exact.verify(depth, *pair)
        certificate["facet_normal"] = [str(x) for x in depth.normal]
        certificate["facet"] = [[int(i), int(j)] for i, j in depth.facet]
    text = format(signed.normalize(), "g") if signed else "0"
    bound = float(signed)
    return {
        "hit": exact.hit(*pair, **radii), "distance": text, "lower": bound, "upper": bound,
        "by": "exact arithmetic on integers", "certificate": certificate,
    }


def _proven(case: Case) -> dict[str, Any]:
    """The bracket that collide proves, and its certificate where it gives one."""
    try:
        r = distance(*case.pair())
        certificate = r.certificate
    except CollideError:
        return {}
    lower, upper = (float(x) if math.isfinite(x) else None for x in (float(r.lower), float(r.upper)))
    plain: Any = _direction_and_points(case, r) if certificate is None else [
        {"kind": c.kind, "part_a": c.part_a, "part_b": c.part_b, "pairs": [list(map(int, p)) for p in c.pairs]}
        for c in certificate
    ]
    by = "the bracket that collide proves" if lower is not None and upper is not None else "nothing"
    return {"hit": bool(r.hit), "lower": lower, "upper": upper, "by": by, "certificate": plain}


def _direction_and_points(case: Case, r: Any) -> dict[str, Any] | None:
    """A direction along which two convex bodies are about as far apart as they are, and their nearest points.

    Anybody can check either bound with a support function and a norm.
    """
    bound = lower_bound(*case.pair())
    if bound is None:
        return None
    made: dict[str, Any] = {"direction": bound[1].tolist(), "gap": bound[0]}
    points = [np.asarray(p).ravel().tolist() for p in (r.point_a, r.point_b)]
    return made | {"points": points} if not r.hit and np.isfinite(points).all() else made


def expected_text(known: dict[str, Any]) -> str:
    """A proof's answer in a few words, for people."""
    word = {True: "overlap or touch", False: "apart", None: "not known"}[known["hit"]]
    farthest = known["upper"] if known["distance"] is None else float(known["distance"])
    if known["hit"] and farthest is not None and farthest < 0.0:
        word = "overlap"
    if known["distance"] is not None:
        return f"{word}, signed distance {known['distance']} m ({known['by']})"
    if known["lower"] is not None and known["upper"] is not None and known["by"] == "the bracket that collide proves":
        return f"{word}, signed distance within [{known['lower']!r}, {known['upper']!r}] m ({known['by']})"
    return f"{word} ({known['by']})"
