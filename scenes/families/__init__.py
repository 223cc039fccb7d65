"""Hard pairs by the family: seeded generators of the inputs on which collision libraries fail.

    from collide.scenes.families import generate, names
    for case in generate("touch_ee", n=100, seed=7):
        A, B, X_WA, X_WB = case.shapes()

27 families follow a published study of other libraries' answers (`STANDARD`); further ones are of
our own making. A case depends on family, seed, index and sizes alone: more cases begin with the same
ones. What sets a pair to a gap asks the exact oracle of `collide.adapters.peers`; nothing here knows
the engine.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from zlib import crc32

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.scenes.families import (
    box_cases,
    lattices,
    mesh_cases,
    nested,
    random_pairs,
    rounded,
    scales,
    swept_hulls,
    thin,
    touching,
)
from collide.scenes.families.case import HALFSPACE, HULLS, Body, Case
from collide.scenes.families.mesh_cases import MeshCase

__all__ = ["HALFSPACE", "HULLS", "STANDARD", "Body", "Case", "MeshCase", "describe", "generate", "mesh_names", "names"]

_FAMILIES: dict[str, Callable[..., Case]] = {
    family.__name__: family
    for module in (random_pairs, touching, box_cases, scales, thin, rounded, nested)
    for family in module.FAMILIES
}
#: The 27 families of the study.
STANDARD: tuple[str, ...] = tuple(_FAMILIES)

_FAMILIES |= {
    family.__name__: family
    for module in (touching, scales, thin, rounded, swept_hulls, lattices)
    for family in module.MORE_FAMILIES
}
#: Of pairs of meshes; their cases are `MeshCase`.
_MESHES: dict[str, Callable[..., MeshCase]] = {family.__name__: family for family in mesh_cases.FAMILIES}


def names() -> list[str]:
    """All families of convex bodies, the 27 of the study first."""
    return list(_FAMILIES)


def mesh_names() -> list[str]:
    """All families of triangle meshes."""
    return list(_MESHES)


def describe(name: str) -> str:
    """The recipe of a family in one sentence; InvalidArgument for an unknown one."""
    return " ".join((inspect.getdoc(_family(name)) or "").split())


def generate(name: str, n: int, seed: int = 0, **size) -> list:
    """n cases of a family: `Case`, or `MeshCase` for families of meshes.

    name : one of `names` or `mesh_names`.   n, seed : whole numbers ≥ 0.
    size : the family's own arguments, for example ``sides`` of "bipyramids" and ``copies`` of "repeats".

    Raises InvalidArgument for an unknown name or size, listing the known ones.
    """
    family = _family(name)
    for argument, value in (("n", n), ("seed", seed)):
        if checks.integer(f"generate: {argument}", value, 0) >= 2**63:
            raise InvalidArgument(f"generate: {argument} must be below 2**63, got {checks.brief(value)}")
    known = [p for p in inspect.signature(family).parameters if p not in ("rng", "index")]
    for argument in size:
        if argument not in known:
            raise InvalidArgument(f"{name} has no size {argument!r}; it has {', '.join(known) or 'none'}")
    return [_case(name, family, k, int(seed), size) for k in range(n)]


def _case(name: str, family: Callable, index: int, seed: int, size: dict):
    rng = np.random.default_rng([seed, crc32(name.encode()), index])
    made = family(rng, index, **size)
    return made._replace(family=name, index=index, seed=seed, size=tuple(sorted(size.items())))


def _family(name: str) -> Callable:
    known = {**_FAMILIES, **_MESHES}
    if checks.text("families: name", name) not in known:
        raise InvalidArgument(f"no family has the name {checks.brief(name)}; there are {', '.join(known)}")
    return known[name]
