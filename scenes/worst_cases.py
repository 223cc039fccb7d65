"""Meshes that are proven to be slow to test: harpsicordia, accordions, Chazelle's polyhedra.

J. Erickson, "Local polyhedra and geometric graphs" (2003), section 4. Two bodies lie on either side of the
saddle z = xy and touch it along *strings*: A along lines x = const, B along lines y = const, so that every string of
A meets every one of B, in one point. Any hierarchy of convex volumes has to look at all those pairs.

* A **harpsicordion** is local: its strings grow by a constant ratio, so that their ends keep apart, and m strings
  need a global stretch exponential in m. Many of them side by side make Θ(n log n) meetings for n vertices.
* An **accordion** has strings of one length: Σ is constant, σ grows with n, and there are Θ(n²) meetings.
* **Chazelle's polyhedron** is the block cut by wedges that the others refine; Θ(n²) too.

All coordinates are short binary fractions, so that strings lie on the saddle exactly and bodies 0 apart touch.
"""

from __future__ import annotations

import math

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import SceneError, brief
from collide.shapes.mesh import Mesh

#: The outline of a fold in its plane (y, z), for a string of length 1: the string's ends and two corners above.
#: Folds are similar about the origin; distinct rays from there keep the vertices of all folds apart.
_ENDS = ((-1 / 2, 0.0), (1 / 2, 0.0))
_CORNERS = ((7 / 8, 7 / 8), (-7 / 8, 7 / 8))
#: The hole through which a fold is joined to the next: lowest, right and left.
_HOLE = ((0.0, 5 / 8), (11 / 32, 13 / 16), (-11 / 32, 13 / 16))
#: An annulus between outline (0 … 3: left end, right end, right corner, left corner) and hole (4 … 6),
#: counter-clockwise seen from +x.
_ANNULUS = ((0, 1, 4), (1, 5, 4), (1, 2, 5), (2, 6, 5), (2, 3, 6), (3, 0, 6), (0, 4, 6))
#: Below this the annulus decides the stretch and not the strings' ends.
LEAST_STRETCH = 6.0
#: So many bodies or strings are more than any memory holds.
_MAX_COUNT = 10**7
#: Longest edge of a fold over the shortest of its hole: a corner to the other, the lowest to the right.
_TEMPLATE_STRETCH = 1.75 / math.hypot(11 / 32, 3 / 16)
#: Significant bits of string lengths: products with their positions stay exact, and shifted copies too.
_BITS = 24


def harpsicordion(strings: int, stretch: float = 10.0) -> Mesh:
    """One harpsicordion, above the saddle: 7 m + 3 vertices, 14 m + 2 facets for m strings.

    strings : m ≥ 1.   stretch : the local stretch σ ≥ 6, kept to a few parts in a million; strings grow by
        σ / (σ − 2), so that Σ is 4.47 (σ / (σ − 2))^m. The shortest string has length 1.
    """
    strings, ratio = count_of("strings", strings), _ratio(stretch)
    lengths = [_short(ratio**k) for k in range(-1, strings)]
    step = 2.0 ** -(10 + (strings - 1).bit_length())
    return Mesh(*_folds(lengths, step), solid=True)


def accordion(strings: int) -> Mesh:
    """An accordion above the saddle: ``strings`` of length 1 within x = ±1/4; σ is 3.5 to 7 times their number."""
    strings = count_of("strings", strings)
    return Mesh(*_folds([1.0] * (strings + 1), 2.0 ** -(1 + (strings - 1).bit_length())), solid=True)


def chazelle(strings: int) -> Mesh:
    """Chazelle's polyhedron as section 4 has it, above the saddle: 6 n + 4 vertices for n strings.

    A block over −n ≤ x, y ≤ n whose underside is folded: the ridges lie on x = −n + 1, −n + 3, … n − 1.
    """
    n = count_of("strings", strings)
    half = float(n)
    high = half * half + half
    vertices: list[tuple] = []
    faces: list[tuple] = []
    rows = []
    for k in range(2 * n + 1):
        x = k - half
        ridge = k % 2 == 1
        for y in (-half, half):
            rows.append(len(vertices))
            vertices.append((x, y, x * y if ridge else high))
            if not ridge:
                vertices.append((x, y, high + 1.0))
    low = np.array(rows).reshape(-1, 2)  # along the underside: (front, back)
    for k in range(2 * n):
        (a, b), (c, d) = low[k], low[k + 1]
        faces += [(a, b, c), (b, d, c)]
    for k in range(0, 2 * n, 2):
        left, ridge, right = low[k], low[k + 1], low[k + 2]
        for side, orientation in ((0, 1), (1, -1)):
            a, b, c = int(left[side]), int(ridge[side]), int(right[side])
            faces += [t[::orientation] for t in ((a, b, c), (a, c, c + 1), (a, c + 1, a + 1))]
        top = [int(left[0]) + 1, int(right[0]) + 1, int(right[1]) + 1, int(left[1]) + 1]
        faces += [(top[0], top[1], top[2]), (top[0], top[2], top[3])]
    for (front, back), orientation in ((low[0], 1), (low[-1], -1)):
        a, b = int(front), int(back)
        faces += [t[::orientation] for t in ((a, b + 1, b), (a, a + 1, b + 1))]
    return Mesh(np.array(vertices), np.array(faces), solid=True)


def below(mesh: Mesh) -> Mesh:
    """The mesh mirrored to the other side of the saddle, (x, y, z) → (y, −x, −z): its strings run the other way."""
    x, y, z = mesh.vertices.T
    return Mesh(np.stack([y, -x, -z], axis=1) + 0.0, mesh.faces[:, ::-1], solid=True)


def harpsicordia(n: int, stretch: float = 10.0, spread: float | None = None) -> tuple[Mesh, Mesh, int]:
    """(A, B, meetings): about n vertices each in harpsicordia side by side, each of A's meeting one of B's.

    stretch : σ ≥ 6.   spread : the global stretch Σ to stay within; n where None, a polynomial in n as locality
        wants it. m ≈ ln(Σ / 4.47) / ln(σ / (σ − 2)) strings each make n m / 7 meetings, Ω(n σ log Σ).
    """
    n = count_of("n", n, 10)
    ratio, spread = _ratio(stretch), n if spread is None else spread
    least = _TEMPLATE_STRETCH * ratio
    spread = checks.number_within(f"spread, for strings of stretch {stretch:g},", spread, least, 1e18, SceneError)
    strings = min(int(math.log(spread / _TEMPLATE_STRETCH) / math.log(ratio)), (n - 3) // 7)
    upper = harpsicordion(strings, stretch)
    copies = max(1, n // len(upper.vertices))
    pitch = 2.0 ** math.ceil(math.log2(2.0 * float(np.abs(upper.vertices).max())))
    wide = math.ceil(math.sqrt(copies))
    places = [(pitch * (k % wide), pitch * (k // wide), 0.0) for k in range(copies)]
    return _copies(upper, places), _copies(below(upper), places), copies * strings**2


def _copies(mesh: Mesh, places: list) -> Mesh:
    moved = [mesh.vertices + np.array(place) for place in places]
    if any(not np.array_equal(v - np.array(place), mesh.vertices) for v, place in zip(moved, places)):
        raise SceneError("so many copies of so large a spread need more digits than a double has; ask for less")
    faces = [mesh.faces + k * len(mesh.vertices) for k in range(len(places))]
    return Mesh(np.concatenate(moved), np.concatenate(faces), solid=True)


def _folds(lengths: list[float], step: float) -> tuple[np.ndarray, np.ndarray]:
    """Folds side by side along x, joined through holes. lengths : of the first hole's fold, then of the strings."""
    n_folds = len(lengths) - 1
    vertices: list[tuple] = []
    faces: list[tuple] = []

    def hole(x: float, length: float) -> list[int]:
        vertices.extend((x, length * y, length * z) for y, z in _HOLE)
        return list(range(len(vertices) - 3, len(vertices)))

    start = -n_folds / 2 * step
    last = hole(start, lengths[0])
    faces.append((last[0], last[2], last[1]))
    for k, length in enumerate(lengths[1:]):
        x = start + (k + 1 / 2) * step
        outline = list(range(len(vertices), len(vertices) + 4))
        vertices.extend((x, length * y, x * (length * y)) for y, _ in _ENDS)  # on the saddle
        vertices.extend((x, length * y, length * z) for y, z in _CORNERS)
        faces += [tuple((outline + last)[v] for v in face[::-1]) for face in _ANNULUS]
        last = hole(start + (k + 1) * step, length)
        faces += [tuple((outline + last)[v] for v in face) for face in _ANNULUS]
    faces.append(tuple(last))
    return np.array(vertices) + 0.0, np.array(faces)


def _ratio(stretch) -> float:
    """By how much strings grow: the ends of one lie σ times nearer to the last one's than it is long."""
    stretch = checks.number_within("stretch", stretch, LEAST_STRETCH, 1e5, SceneError)
    return stretch / (stretch - 2.0)


def _short(length: float) -> float:
    """The length rounded to a few significant bits."""
    if not 2.0**-60 < length < 2.0**60:
        raise SceneError(f"so many strings of that stretch reach lengths of {length:.3g}; ask for fewer")
    exponent = math.frexp(length)[1]
    return math.ldexp(round(math.ldexp(length, _BITS - exponent)), exponent - _BITS)


def count_of(name: str, value, least: int = 1) -> int:
    """How many bodies, layers or strings a scene has. Raises SceneError."""
    count = checks.integer(name, value, least, SceneError)
    if count > _MAX_COUNT:
        raise SceneError(f"{name} must be at most {_MAX_COUNT}, got {brief(value)}")
    return count
