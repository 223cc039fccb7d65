"""Any function of r solids' memberships as a single solid, in a single arrangement: `combine`."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Sequence

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.shapes.shape import Shape
from collide.solids.arrangement import arrange
from collide.solids.boolean import BooleanResult, check_rounding, solid_of
from collide.solids.limits import Limits
from collide.solids.placed_facets import Operand
from collide.solids.solid_operands import solid_operand

#: From r bools, a bool a body: whether points held by exactly these bodies belong to the result.
MembershipRule = Callable[[tuple[bool, ...]], bool]

RULES: dict[str, MembershipRule] = {
    "union": any,
    "intersection": all,
    "parity": lambda bits: sum(bits) % 2 == 1,
}


def combine(
    shapes: Sequence[Shape], poses, rule: str | MembershipRule, *, rounding: str = "clean", check_poses: bool = True,
    progress=None, time_limit: float | None = None, memory: int | None = None,
) -> BooleanResult:
    """A solid from r posed solids, by any rule on the set of solids holding a point; decided exactly.

    A chain of booleans of pairs rounds between its steps; `combine` works in a single arrangement of the bodies as
    given.

    Parameters
    ----------
    shapes : r ≥ 1 solids with facets, as for `boolean`.
    poses : (r, 4, 4) in the world W [m].
    rule : "union", "intersection", "parity" (in an odd number of bodies), "at least k" with a number k; or a function
        of a tuple of r bools, asked once for every occurring combination of bodies: whether points held by exactly
        these belong to the result. Points outside all bodies must not belong.
    rounding : "clean" or "exact", as of `boolean`.
    check_poses : refuse matrices other than rotations.
    progress, time_limit, memory : as of `boolean`.

    Returns
    -------
    BooleanResult; ``body`` has rows of ``shapes``. The order of the bodies changes no bit of the mesh: of coinciding
    surfaces the mesh has the facet of a single body, independent of their order, and ``before`` and ``behind``
    show all.

    Raises
    ------
    InvalidArgument : no shapes, another number of poses; an unknown rule, a rule that raises, answers no bool or
        includes the outside of all bodies; a surface without an inside, by its place in ``shapes``.
    InvalidPose, UnsupportedQuery : as `boolean`.

    Notes
    -----
    J. Erickson, "Local polyhedra and geometric graphs" (2005), theorem 6.1: the arrangement of r local polyhedra with n
    facets each has O(r³ n log² n) vertices, a bound of the number of cuts. docs/solids.md has the figures.
    """
    check_rounding("combine", rounding)
    operands = _operands(shapes, poses, check_poses)
    asked = _rule(rule, len(operands))
    order = _canonical_order(operands)
    asked_once = _asked("combine", asked, np.zeros((1, len(operands)), dtype=bool))
    if asked_once[0]:
        raise InvalidArgument("combine: the rule says that what no body holds belongs: it would have no end")
    with Limits("combine", progress, time_limit, memory) as limits:
        arrangement = arrange([operands[k] for k in order], limits)
        holds = np.empty_like(arrangement.holds())
        holds[:, order] = arrangement.holds()
        patterns, which = np.unique(holds, axis=0, return_inverse=True)
        r = solid_of(arrangement, _asked("combine", asked, patterns)[which.ravel()], rounding)
    back = np.argsort(order)
    return r._replace(body=order[r.body], before=r.before[:, back], behind=r.behind[:, back])


def _operands(shapes, poses, check_poses: bool) -> list[Operand]:
    if isinstance(shapes, Shape) or not isinstance(shapes, Sequence) or not len(shapes):
        raise InvalidArgument(f"combine: shapes must be a list of one or more solids, got {brief(shapes)}")
    poses = checks.listed_entries("combine: poses", poses, f"a pose for each of {len(shapes)} shapes, (r, 4, 4)")
    if len(poses) != len(shapes):
        raise InvalidArgument(
            f"combine: {len(shapes)} shapes need as many poses, (r, 4, 4), got {len(poses)}: shapes {brief(shapes)}, "
            f"poses {brief(poses)}"
        )
    return [
        solid_operand("combine", f"shapes[{k}]", shape, X, check_poses, f"poses[{k}]")
        for k, (shape, X) in enumerate(zip(shapes, poses))
    ]


def _rule(rule, r: int) -> MembershipRule:
    if callable(rule):
        return rule
    known = RULES.get(rule) if isinstance(rule, str) else None
    if known is not None:
        return known
    counted = re.fullmatch(r"at least (\d{1,9})", rule) if isinstance(rule, str) else None
    if counted is None or int(counted[1]) < 1:
        names = ", ".join(repr(name) for name in RULES)
        raise InvalidArgument(
            f"combine: rule must be {names}, 'at least k' with k ≥ 1, or a function of {r} bools, got {brief(rule)}"
        )
    least = int(counted[1])
    return lambda bits: sum(bits) >= least


def _asked(caller: str, rule: MembershipRule, patterns: np.ndarray) -> np.ndarray:
    """(c,) bool: the rule's answers to patterns (c, r)."""
    answers = []
    for bits in map(tuple, patterns.tolist()):
        held = f"bodies {[k for k, bit in enumerate(bits) if bit]} of {len(bits)}"
        try:
            answer = rule(bits)
        except Exception as error:
            raise InvalidArgument(
                f"{caller}: rule {brief(rule)} raised {type(error).__name__} of {held}: {brief(str(error))}"
            ) from error
        if not isinstance(answer, (bool, np.bool_)):
            raise InvalidArgument(
                f"{caller}: rule {brief(rule)} must answer True or False, of {held} it answered {brief(answer)}"
            )
        answers.append(bool(answer))
    return np.array(answers)


def _canonical_order(operands: list[Operand]) -> np.ndarray:
    """(r,) rows of the bodies in an order that depends on what they are alone, equal ones by their places."""
    keys = []
    for operand in operands:
        digest = hashlib.sha256(np.ascontiguousarray(operand.X).tobytes())
        for array in (operand.mesh.vertices, operand.mesh.faces):
            digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        keys.append(digest.digest())
    return np.array(sorted(range(len(keys)), key=lambda k: (keys[k], k)))
