"""What a triangle surface must be before standing for a body: welding, topology, volumes, in one pass."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of, code_of, entry, kernel, native_call, view_f64, view_i32, view_i64
from collide.mesh import mesh_topology as topology
from collide.mesh.mesh_topology import COLLAPSED, COUNTS, ONE_SIDED, OPEN, TURNED, UNBALANCED
from collide.mesh.shell_nesting import judge_shells, shells_memory
from collide.mesh.shell_volumes import without_area
from collide.mesh.weld import first_rows

# Further flags of a facet; the first ones stand in `mesh_topology.py`.
NO_AREA = 1 << 16     # its corners lie on one line, or two of them are one point
INSIDE_OUT = 1 << 17  # its shell has a negative volume and is no cavity
EMPTY = 1 << 18       # its shell encloses nothing

#: Flags of surfaces that have no inside.
NOT_CLOSED = OPEN | UNBALANCED | TURNED | ONE_SIDED

_first_rows_at = native_call("void(int64, int64, int64, int64, int64)")
_classify_facets_at = native_call("void(int64, int64, int64, int64, int64, int64, int64)")
_judge_shells_at = native_call("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")


class Survey(NamedTuple):
    """The surface of n vertices and f facets.

    corners : (f, 3) int32, the faces with equal points named by the first of them; the faces
        themselves where no two vertices are equal.
    flags : (f,) int32, bits of `mesh_topology.py` and of this module.
    shells : (f,) int32, parts that close by themselves, numbered by their first facets; −1 for
        facets with two equal corners. Parts in touch along edges or at vertices only stay apart.
    volumes, signs : (shells,) float64 [m³] and int8; empty unless the surface is closed. Signs are exact.
    edges, open_edges, pinches, used : how many edges, edges with a single facet, vertices where fans
        of facets touch, and distinct vertices of facets.
    welded : how many vertices equal an earlier one.
    """

    corners: np.ndarray
    flags: np.ndarray
    shells: np.ndarray
    volumes: np.ndarray
    signs: np.ndarray
    n_shells: int
    edges: int
    open_edges: int
    pinches: int
    used: int
    welded: int

    @property
    def closed(self) -> bool:
        """Whether the facets wind a definite number of times around every point off them."""
        return self.edges > 0 and not (self.flags & NOT_CLOSED).any()

    @property
    def euler(self) -> int:
        """Distinct vertices − edges + facets, without collapsed ones."""
        return self.used - self.edges + int(((self.flags & COLLAPSED) == 0).sum())


@kernel
def _table_size(n):
    """Integers of the table that n vertices are looked up in."""
    size = 16
    while size < 2 * n:
        size *= 2
    return size


@entry("int64(int64, int64)")
def survey_memory(n, n_facets):
    """Bytes of memory for `survey_facets`, beside the bytes of `shells_memory` for as many shells as facets."""
    return 4 * n_facets + 8 + max(28 * n + 4 * _table_size(n), 4 * (12 * n_facets + 4 * n + 1))


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def survey_facets(
    codes_at, vertices_at, n, faces_at, n_facets, corners_at, flags_at, shells_at, counts_at, volumes_at, signs_at,
    memory_at,
):
    """Survey a surface, for Python and C; returns 1 if there is an inside: closed, a shell of positive volume, and no
    shell inside out. Else 0.

    codes : addresses of the compiled `first_rows`, `classify_facets`, `judge_shells`, to call.
    faces : (f, 3) int32.   corners, flags, shells, counts : out, as of `classify_facets`.   volumes, signs : room for f
    numbers; a closed surface writes an entry for each shell, as `judge_shells`.   memory : as many bytes as
    `survey_memory` and `shells_memory` say together.
    """
    codes, vertices, counts = view_i64(codes_at, 3), view_f64(vertices_at, 3 * n), view_i64(counts_at, COUNTS)
    at, size = memory_at + (4 * n_facets + 7) // 8 * 8, _table_size(n)  # behind which shells are inside out
    points, table, first = view_f64(at, 3 * n), view_i32(at + 24 * n, size), view_i32(at + 24 * n + 4 * size, n)
    faces, corners = view_i32(faces_at, 3 * n_facets), view_i32(corners_at, 3 * n_facets)
    for k in range(3 * n):
        points[k] = vertices[k] + 0.0  # −0.0 and 0.0 are one number
    for k in range(size):
        table[k] = -1
    _first_rows_at(codes[0], (at, n, at + 24 * n, size, at + 24 * n + 4 * size))
    n_welded = 0
    for k in range(n):
        n_welded += 1 if first[k] != k else 0
    for k in range(3 * n_facets):
        corners[k] = first[faces[k]]
    _classify_facets_at(codes[1], (corners_at, n_facets, n, flags_at, shells_at, counts_at, at))
    counts[topology.WELDED] = n_welded
    flags, shells = view_i32(flags_at, n_facets), view_i32(shells_at, n_facets)
    is_closed = counts[topology.EDGES] > 0
    for f in range(n_facets):
        is_closed = is_closed and flags[f] & NOT_CLOSED == 0
    if not is_closed:
        return 0
    n_shells = counts[topology.SHELLS]
    _judge_shells_at(
        codes[2],
        (vertices_at, n, corners_at, n_facets, shells_at, n_shells, volumes_at, signs_at, memory_at, at),
    )
    signs, wrong = view_i32(signs_at, n_shells), view_i32(memory_at, n_shells)
    for f in range(n_facets):
        if shells[f] >= 0:
            flags[f] |= INSIDE_OUT if wrong[shells[f]] != 0 else 0
            flags[f] |= EMPTY if signs[shells[f]] == 0 else 0
    n_positive = 0
    n_wrong = 0
    for shell in range(n_shells):
        n_positive += 1 if signs[shell] > 0 else 0
        n_wrong += wrong[shell]
    return 1 if n_positive > 0 and n_wrong == 0 else 0


@entry("int64(int64, int64, int64, int64, int64)")
def one_of_each_part(corners_at, shells_at, n_facets, n, ids_at):
    """Write a vertex of every shell, in order, then the vertices of collapsed facets alone, ascending; returns how
    many.

    corners, shells : of a survey of n vertices.   ids : int32, room for n ids and for an id of every shell.
    """
    corners, shells = view_i32(corners_at, 3 * n_facets), view_i32(shells_at, n_facets)
    ids = view_i32(ids_at, n + n_facets)
    n_ids = 0
    for f in range(n_facets):
        if shells[f] == n_ids:  # numbered by their first facets
            ids[n_ids] = corners[3 * f]
            n_ids += 1
    uses = view_i32(ids_at + 4 * n_ids, n)
    for vertex in range(n):
        uses[vertex] = 0
    for f in range(n_facets):
        for k in range(3):
            uses[corners[3 * f + k]] |= 1 if shells[f] < 0 else 2
    for vertex in range(n):
        if uses[vertex] == 1:
            ids[n_ids] = vertex
            n_ids += 1
    return n_ids


@cache
def _codes() -> np.ndarray:
    """What `survey_facets` calls."""
    return np.array([code_of(step) for step in (first_rows, topology.classify_facets, judge_shells)])


def survey_surface(vertices: np.ndarray, faces: np.ndarray) -> Survey:
    """Survey a surface; nothing is refused, everything is flagged.

    vertices : (n, 3) finite float64.   faces : (f, 3) int32 within 0 … n − 1, f ≥ 1.
    About 0.4 µs a facet; facets and shells on which doubles cannot decide cost microseconds each.
    """
    points, n, m = np.ascontiguousarray(vertices), len(vertices), len(faces)
    faces = np.ascontiguousarray(faces)
    corners, counts, volumes = np.empty((m, 3), dtype=np.int32), np.empty(COUNTS, dtype=np.int64), np.empty(m)
    flags, shells, signs = (np.empty(m, dtype=np.int32) for _ in range(3))
    memory = np.empty((survey_memory(n, m) + shells_memory(n, m, m)) // 8 + 1, dtype=np.int64)
    arrays = corners, flags, shells, counts, volumes, signs, memory
    survey_facets(address_of(_codes()), address_of(points), n, address_of(faces), m, *map(address_of, arrays))
    welded = int(counts[topology.WELDED])
    corners = corners if welded else faces
    flags[without_area(vertices, corners)] |= NO_AREA
    n_shells, edges, open_edges = (int(counts[k]) for k in (topology.SHELLS, topology.EDGES, topology.OPEN_EDGES))
    survey = Survey(
        corners, flags, shells, volumes[:0], np.zeros(0, dtype=np.int8), n_shells, edges, open_edges,
        int(counts[topology.PINCHES]), int(counts[topology.USED]), welded,
    )
    if not survey.closed:
        return survey
    return survey._replace(volumes=volumes[:n_shells].copy(), signs=signs[:n_shells].astype(np.int8))
