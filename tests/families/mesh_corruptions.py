"""Meshes spoilt at random, and one question asked of each: refused with the row to blame, or right by exact arithmetic.

What is right is `collide.adapters.peers.exact_meshes`, which shares no code with the engine, and what is a solid a
test of edges written here.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide import Box, CollideError, Mesh, Sphere, collide, distance, pose
from collide.adapters.peers import exact_meshes
from collide.adapters.peers.question import corners

#: Kinds of corruption; "as it is" comes first.
KINDS = (
    "as it is", "flip facets", "drop facets", "duplicate facets", "NaN vertices", "ids out of range", "merge vertices",
    "move vertices", "tiny", "huge", "tiny facets beside", "collapse facets", "turn all", "snap", "shuffle ids",
)
#: What a refusal must name: a row, or that there is none.
NAMED = re.compile(r"(vertices|faces)\[\d+(, \d+)?\]|no facets|largest coordinate")


class Spoilt(NamedTuple):
    """Vertices (n, 3), facets (m, 3), what was done; ``refused``: it must not become a mesh."""

    kind: str
    vertices: np.ndarray
    faces: np.ndarray
    refused: bool


def spoil(rng: np.random.Generator, vertices: np.ndarray, faces: np.ndarray, kind: str) -> Spoilt:
    """A mesh after one corruption of the kind."""
    v, f, refused = vertices.copy(), faces.copy(), False
    n, m = len(v), len(f)
    some = rng.permutation(m)[: max(1, int(m * rng.choice([0.01, 0.1, 0.5])))]
    points = rng.permutation(n)[: max(1, int(n * rng.choice([0.01, 0.1, 0.5])))]
    size = float(np.ptp(v, axis=0).max()) or 1.0
    if kind == "flip facets":
        f[some] = f[some][:, ::-1]
    elif kind == "drop facets":
        f = np.delete(f, some, axis=0)
        refused = not len(f)
    elif kind == "duplicate facets":
        again = f[some]
        f = np.concatenate(
            [f, again if rng.random() < 0.5 else again[:, [1, 2, 0]] if rng.random() < 0.5 else again[:, ::-1]]
        )
    elif kind == "NaN vertices":
        v[points[0], rng.integers(3)] = rng.choice([np.nan, np.inf, -np.inf, 1e60])
        refused = True
    elif kind == "ids out of range":
        f[some[0], rng.integers(3)] = rng.choice([-1, n, n + 7, 2**31 - 1])
        refused = True
    elif kind == "merge vertices":
        f = f.copy()
        f[np.isin(f, points)] = points[0]
    elif kind == "move vertices":
        v[points] += rng.normal(size=(len(points), 3)) * size * rng.choice([1e-9, 1e-3, 0.1, 1.0])
    elif kind == "tiny":
        v = v * 1e-12
    elif kind == "huge":
        v = v * 1e12
    elif kind == "tiny facets beside":
        # 1e-12 m triangles beside 1 km ones
        v = v * (1000.0 / size)
        at = v[rng.integers(n)]
        crumbs = at + rng.normal(size=(6, 3)) * 1e-12
        v, f = np.concatenate([v, crumbs]), np.concatenate([f, np.arange(n, n + 6).reshape(2, 3)])
    elif kind == "collapse facets":
        f[some, 1] = f[some, 0]
    elif kind == "turn all":
        f = f[:, ::-1]
    elif kind == "snap":
        unit = size / rng.choice([4, 16, 256])
        v = np.round(v / unit) * unit
    elif kind == "shuffle ids":
        f[some] = rng.integers(0, n, size=(len(some), 3))
    return Spoilt(kind, np.ascontiguousarray(v), np.ascontiguousarray(f), refused)


class Said(NamedTuple):
    """outcome : "refused", "hit", "inside" (a hit by an inside alone) or "apart".   wrong : what is, in words; or
    nothing."""

    outcome: str
    solid: bool
    wrong: str


def ask(rng: np.random.Generator, spoilt: Spoilt, *, deep: bool = False) -> Said:
    """Make a mesh of it and ask about a probe beside one of its facets.

    deep : ask how deep the pair is, too, which takes milliseconds.
    """
    try:
        mesh = Mesh(spoilt.vertices, spoilt.faces)
    except CollideError as error:
        if not spoilt.refused:
            return Said("refused", False, f"refused: {error}")
        return Said("refused", False, "" if NAMED.search(str(error)) else f"no row is named: {error}")
    if spoilt.refused:
        return Said("apart", False, "it was taken")
    wrong = _wrong_solid(mesh)
    probe, X_WA, X_WB = _probe(rng, mesh)
    A, B = exact_meshes.mesh_cells(mesh.vertices, mesh.faces, mesh.solid, X_WA), _cells(probe, X_WB)
    truth = exact_meshes.judge(A, B)
    hit, turned = collide(mesh, probe, X_WA, X_WB), collide(probe, mesh, X_WB, X_WA)
    if not hit == turned == truth.hit and not _too_near(mesh, probe, X_WA, X_WB, truth):
        wrong = wrong or f"collide says {hit}, swapped {turned}, exact arithmetic {truth}"
    r = distance(mesh, probe, X_WA, X_WB, signed=deep)
    if truth.distance is None:
        if not (r.lower <= 0.0 and (r.lower <= r.upper if deep else r.upper + 5e-324 >= 0.0)):
            wrong = wrong or f"distance says {r.lower} … {r.upper} of bodies that meet"
    elif not np.nextafter(r.lower, -np.inf) <= truth.distance <= np.nextafter(r.upper, np.inf):
        wrong = wrong or f"distance says {r.lower} … {r.upper}, exact arithmetic {truth.distance!r}"
    outcome = ("hit" if truth.surfaces else "inside") if truth.hit else "apart"
    return Said(outcome, mesh.solid, wrong)


def _too_near(mesh: Mesh, probe, X_WA, X_WB, truth) -> bool:
    """Swept balls that touch within rounding are a hit by rule: then the bracket reaches to both sides of 0."""
    if not isinstance(probe, Sphere) or truth.hit:
        return False
    r = distance(mesh, probe, X_WA, X_WB, signed=False)
    return bool(r.hit and not r.certified and r.lower <= 0.0 <= r.upper)


def _cells(probe, X_WB: np.ndarray) -> exact_meshes.Cells:
    if isinstance(probe, Mesh):
        return exact_meshes.mesh_cells(probe.vertices, probe.faces, probe.solid, X_WB)
    found = corners(probe)
    assert found is not None
    return exact_meshes.convex_cells(*found, X_WB)


def _probe(rng: np.random.Generator, mesh: Mesh):
    """(shape, X_WA, X_WB): a box, a ball, a small mesh or the mesh itself, beside a facet of the mesh."""
    size = float(np.ptp(mesh.vertices[np.unique(mesh.faces)], axis=0).max()) or 1.0
    facet = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces))]]
    place = facet.mean(axis=0) if rng.random() < 0.7 else facet[0] if rng.random() < 0.5 else mesh.vertices.mean(axis=0)
    side = size * float(rng.choice([1e-3, 0.02, 0.1, 0.5]))
    away = rng.normal(size=3)
    away *= side * float(rng.choice([0.0, 0.3, 1.0, 1.5, 3.0])) / np.sqrt((away**2).sum())
    rpy = (0, 0, 0) if rng.random() < 0.3 else rng.uniform(-3, 3, 3)
    X_WA = np.eye(4) if rng.random() < 0.5 else pose(rng.normal(size=3) * size, rpy=rng.uniform(-3, 3, 3))
    at = (X_WA[:3, :3] * (place + away)).sum(axis=1) + X_WA[:3, 3]
    X_WB = pose(at, rpy=rpy)
    kind = rng.integers(4)
    if kind == 0:
        return Box(side * rng.uniform(0.2, 1, 3)), X_WA, X_WB
    if kind == 1:
        return Sphere(side * 0.5), X_WA, X_WB
    if kind == 2:
        box = corners(Box(side * rng.uniform(0.2, 1, 3)))
        assert box is not None
        return Mesh(box[0], _BOX[: rng.integers(8, 13)] if rng.random() < 0.3 else _BOX), X_WA, X_WB
    return mesh.scaled(0.125), X_WA, X_WB


_BOX = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5], [2, 3, 7], [2, 7, 6],
     [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)


# --- what is a solid --------------------------------------------------------------------------------


def _wrong_solid(mesh: Mesh) -> str:
    """Whether ``mesh.solid`` contradicts what its edges say, where they say anything."""
    ids = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)[1].ravel()[mesh.faces]
    proper = ids[(ids[:, 0] != ids[:, 1]) & (ids[:, 1] != ids[:, 2]) & (ids[:, 2] != ids[:, 0])]
    if not len(proper):
        return "no facet has three corners, and it is a solid" if mesh.solid else ""
    edges = proper[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    key = np.sort(edges, axis=1)
    _, group = np.unique(key, axis=0, return_inverse=True)
    balance = np.zeros(group.max() + 1, dtype=np.int64)
    np.add.at(balance, group.ravel(), np.where(edges[:, 0] < edges[:, 1], 1, -1))
    balanced, many = not balance.any(), np.bincount(group.ravel())
    if mesh.solid and not balanced:
        return "an edge is run along more often one way, and it is a solid"
    if not mesh.solid and balanced and (many == 2).all() and _in_one_part(proper) and _volume(mesh, proper, ids) > 0:
        return "it closes, hangs together, encloses a positive volume, and is no solid"
    return ""


def _in_one_part(ids: np.ndarray) -> bool:
    """By edges, of which each has two facets."""
    key = np.sort(ids[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, group = np.unique(key, axis=0, return_inverse=True)
    group = group.ravel().reshape(-1, 3)
    labels = np.arange(group.max() + 1)
    while True:
        before = labels.copy()
        np.minimum.at(labels, group, labels[group].min(axis=1)[:, None])
        labels = labels[labels]
        if np.array_equal(labels, before):
            return bool((labels[group] == labels[group[0, 0]]).all())


def _volume(mesh: Mesh, proper: np.ndarray, ids: np.ndarray) -> Fraction:
    """Six times the volume, exactly."""
    of = dict(zip(ids.ravel().tolist(), mesh.faces.ravel().tolist()))
    points = {k: [Fraction(x) for x in mesh.vertices[row].tolist()] for k, row in of.items()}
    total = Fraction(0)
    for a, b, c in proper.tolist():
        p, q, r = points[a], points[b], points[c]
        total += (
            p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0]) + p[2] * (q[0] * r[1] - q[1] * r[0])
        )
    return total
