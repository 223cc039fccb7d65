"""The polar transformation of polyhedra, by the definitions and in fractions.

Barba, Langerman, "Optimal detection of intersections between convex polyhedra", section 3. For a point x, ρ(x) is the
plane {y : ⟨x, y⟩ = 1}; ρ0(x) is its closed side with the origin, ρ∞(x) the other one. For a polyhedron P,

    ρ0(P) = {y : ⟨v, y⟩ ≤ 1 for all v ∈ P},    ρ∞(P) = {y : ⟨v, y⟩ ≥ 1 for all v ∈ P}.

A `Polyhedron` is points plus rays: conv(vertices) + cone(rays), or, the other way, an intersection of half-spaces. Both
sets are polyhedra again: a vertex v gives ⟨v, y⟩ ≤ 1 (or ≥ 1), a ray d gives ⟨d, y⟩ ≤ 0 (or ≥ 0).

Theorem 3.7: P and ρ0(Q) intersect if and only if a plane separates ρ∞(P) from Q. Witnesses are carried both ways:
x ∈ P ∩ ρ0(Q) gives the plane ρ(x); a plane {y : ⟨x, y⟩ = 1} with ⟨x, y⟩ ≥ 1 on ρ∞(P), *tangent to it*, and ≤ 1 on Q
gives x. Where ρ∞(P) is empty (the origin is in P) no plane is tangent to it; then the origin itself is common to both,
and `separating_plane` has no plane that misses the origin to give.

Everything here is exact, for tests and for reading; nothing is fast. Vectors are tuples of three Fractions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import combinations
from typing import NamedTuple

Vector = tuple[Fraction, Fraction, Fraction]
ORIGIN: Vector = (Fraction(0), Fraction(0), Fraction(0))


class Halfspace(NamedTuple):
    """{y : ⟨normal, y⟩ ≤ offset}."""

    normal: Vector
    offset: Fraction


class Polyhedron(NamedTuple):
    """conv(vertices) + cone(rays); without vertices it is empty. Not every vertex need be extreme."""

    vertices: tuple[Vector, ...]
    rays: tuple[Vector, ...] = ()


def vector(values: Iterable) -> Vector:
    """Three numbers as fractions; doubles are taken as they are."""
    x, y, z = (Fraction(value) for value in values)
    return x, y, z


def polyhedron(points: Iterable, rays: Iterable = ()) -> Polyhedron:
    """From rows of numbers."""
    return Polyhedron(tuple(vector(p) for p in points), tuple(vector(d) for d in rays))


def inner(a: Vector, b: Vector) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def scaled(a: Vector, factor: Fraction) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor


# --- the definitions ----------------------------------------------------------------------------


def polar_zero(body: Polyhedron) -> list[Halfspace]:
    """ρ0(P) by half-spaces. It is bounded if and only if the origin is inside P."""
    return [Halfspace(v, Fraction(1)) for v in body.vertices] + [Halfspace(d, Fraction(0)) for d in body.rays]


def polar_infinity(body: Polyhedron) -> list[Halfspace]:
    """ρ∞(P) by half-spaces. It is empty if the origin is in P."""
    return [Halfspace(scaled(h.normal, Fraction(-1)), -h.offset) for h in polar_zero(body)]


def contains(halfspaces: Iterable[Halfspace], x: Vector) -> bool:
    return all(inner(h.normal, x) <= h.offset for h in halfspaces)


def within_zero(body: Polyhedron, x: Vector) -> bool:
    """P ⊆ ρ0(x), which is x ∈ ρ0(P) (Lemma 3.3)."""
    return all(inner(v, x) <= 1 for v in body.vertices) and all(inner(d, x) <= 0 for d in body.rays)


def within_infinity(body: Polyhedron, x: Vector) -> bool:
    """P ⊆ ρ∞(x), which is x ∈ ρ∞(P)."""
    return all(inner(v, x) >= 1 for v in body.vertices) and all(inner(d, x) >= 0 for d in body.rays)


def from_halfspaces(halfspaces: Sequence[Halfspace]) -> Polyhedron:
    """Vertices and rays of an intersection of half-spaces, by trying all triples; O(m⁴).

    The intersection must have a vertex or be empty: ValueError where it contains a line.
    """
    planes = [h for h in dict.fromkeys(halfspaces) if any(h.normal)]
    if any(h.offset < 0 for h in halfspaces if not any(h.normal)):
        return Polyhedron(())
    if _rank([h.normal for h in planes]) < 3:
        raise ValueError("the half-spaces contain a line, so their intersection has no vertex")
    vertices: dict[Vector, None] = {}
    rays: dict[Vector, None] = {}
    for f, g in combinations(planes, 2):
        along = cross(f.normal, g.normal)
        for ray in (along, scaled(along, Fraction(-1))) if any(along) else ():
            if all(inner(h.normal, ray) <= 0 for h in planes):
                rays[_primitive(ray)] = None
    for f, g, h in combinations(planes, 3):
        determinant = inner(f.normal, cross(g.normal, h.normal))
        if determinant:
            terms = (
                scaled(cross(g.normal, h.normal), f.offset), scaled(cross(h.normal, f.normal), g.offset),
                scaled(cross(f.normal, g.normal), h.offset),
            )
            x = vector(sum(parts) / determinant for parts in zip(*terms))
            if contains(planes, x):
                vertices[x] = None
    return Polyhedron(tuple(vertices), tuple(rays) if vertices else ())


def _rank(normals: Sequence[Vector]) -> int:
    first = next((n for n in normals if any(n)), None)
    if first is None:
        return 0
    second = next((n for n in normals if any(cross(first, n))), None)
    if second is None:
        return 1
    return 3 if any(inner(cross(first, second), n) for n in normals) else 2


def _primitive(ray: Vector) -> Vector:
    """The same direction, the first nonzero component ±1."""
    lead = next(x for x in ray if x)
    return scaled(ray, 1 / abs(lead))


# --- Theorem 3.7, witnesses carried across ------------------------------------------------------


class Plane(NamedTuple):
    """{y : ⟨normal, y⟩ = 1}, the polar of the point ``normal``."""

    normal: Vector


def separating_plane(x: Vector) -> Plane:
    """ρ(x) for a common point x of P and ρ0(Q): it separates ρ∞(P), on its far side, from Q, on the origin's.

    ValueError for the origin, whose polar is no plane: there P contains the origin and ρ∞(P) is empty.
    """
    if not any(x):
        raise ValueError("the polar of the origin is no plane: ρ∞(P) is empty and every plane separates it")
    return Plane(x)


def common_point(plane: Plane, far: Polyhedron) -> Vector:
    """A point of P ∩ ρ0(Q) from a plane that separates ρ∞(P) = ``far`` from Q, with Q on the origin's side.

    The plane is moved until it is tangent: the polar of a plane ⟨z, y⟩ = t, t > 0, is z / t.
    ValueError where ``far`` is empty, or the plane does not have it on its far side.
    """
    if not far.vertices:
        raise ValueError("ρ∞(P) is empty: P contains the origin, which is the common point")
    least = min(inner(plane.normal, v) for v in far.vertices)
    if least < 1 or any(inner(plane.normal, d) < 0 for d in far.rays):
        raise ValueError("ρ∞(P) is not on the far side of the plane")
    return scaled(plane.normal, 1 / least)


def separates(plane: Plane, near: Polyhedron, far: Polyhedron) -> bool:
    """Whether a polyhedron is on the origin's closed side of a plane and the other on the far closed side."""
    return within_zero(near, plane.normal) and within_infinity(far, plane.normal)
