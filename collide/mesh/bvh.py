"""The tree that mesh queries walk: nodes of eight boxes, triangles in the order of the leaves.

A node is 56 words of 32 bits: eight boxes as centres x, y, z and half lengths x, y, z, eight floats each,
then eight links. A link ≥ 0 is a node, a negative link a leaf (`leaf_link`): a run of triangles. Node 0 has a single
box, around the whole mesh. An unused slot has a half length of −1e30, so no probe meets its box.

Boxes are held relative to ``centre`` and in units of 2^exponent, rounded outwards: floats are then as good for
a mesh of microns far from its origin as for a mesh of kilometres. Triangles are the doubles given, unrounded.

Where these floats are too coarse, since details are small beside the whole mesh (`fine_boxes.py`), the boxes of a tree
are held relative to an *origin* of their node (``has_origins``). The origin stands in the lowest bytes of the node's
half lengths, four bytes for each coordinate, so a node is as large as without.
"""

from __future__ import annotations

import hashlib
import math
from typing import NamedTuple

import numpy as np

from collide.base.fork_safe_lock import ForkSafeLock
from collide.kernels import address_of, kernel, view_f32, view_f64, view_i32, view_i64
from collide.numerics.vec3 import Vec3, add

#: Boxes of a node, and its words: six floats a box and a link.
WIDTH = 8
NODE = 7 * WIDTH
#: Floats of a node's eight slabs (`bvh_slabs.py`): normals x, y, z, middles, half widths.
SLAB = 5 * WIDTH
#: Half length of a slot that is not used.
NOTHING = -1e30
#: An origin is so many times a whole number of 32 bits along each axis.
ORIGIN_STEP = 2.0**-30
#: Triangles of a leaf at most: three bits of a link hold their number.
MAX_LEAF = 7
#: Facets of a mesh at most: a leaf's link holds its first triangle in 28 bits.
MAX_FACETS = 1 << 28

# Header that kernels read: integers, and the address of the numbers. Trees over points that came and went have empty
# places in leaves: N_FACETS counts places, and is no less than the points.
NODES_AT, TRIANGLES_AT, IDS_AT, NUMBERS_AT, N_NODES, N_FACETS, DEPTH, EXPONENT, SLABS_AT, HAS_ORIGINS = range(10)
INTS = 10
# Numbers: centre (3), largest |coordinate| of the triangles by axis (3), radius of a ball around the centre.
CENTRE, REACH, RADIUS = 0, 3, 6
NUMBERS = 7


class MeshTree:
    """A mesh's facets under a tree of boxes, read-only; `build.build_mesh_tree` makes one.

    nodes : (k, 56) int32, as the module says.
    triangles : (m, 9) float64, the corners of the facets in the order of the leaves, in the mesh's frame [m].
    ids : (m,) int32, the number of each of them among the facets given.
    centre, exponent : what boxes are relative to [m], and their unit as a power of two.
    depth : nodes on the longest way down.
    address : of the header that kernels take; valid as long as this object lives.
    has_origins : whether boxes are relative to an origin of their node.
    content : digest of triangles and their numbers: it orders the bodies of a pair.

    With ``check`` a structure that would lead kernels out of the arrays, as from a damaged file, is refused.
    """

    def __init__(
        self, nodes, triangles, ids, centre, exponent: int, depth: int, has_origins: bool = False, check: bool = True
    ):
        self.nodes = np.ascontiguousarray(nodes, dtype=np.int32)
        self.triangles = np.ascontiguousarray(triangles, dtype=np.float64)
        self.ids = np.ascontiguousarray(ids, dtype=np.int32)
        self.centre = np.array(centre, dtype=np.float64)
        self.exponent, self.depth, self.has_origins = int(exponent), int(depth), bool(has_origins)
        if check:
            self._check_structure()
        corners = np.abs(self.triangles).reshape(-1, 3)
        self.numbers = np.concatenate([self.centre, corners.max(axis=0), [self._radius()]])
        self.header = np.array(
            [
                address_of(self.nodes), address_of(self.triangles), address_of(self.ids), address_of(self.numbers),
                len(self.nodes), len(self.ids), self.depth, self.exponent, 0, self.has_origins,
            ],
            dtype=np.int64,
        )
        self.address = address_of(self.header)
        self._content: bytes | None = None
        self._slabs: np.ndarray | None = None
        self._places: np.ndarray | None = None
        for part in (self.nodes, self.triangles, self.ids, self.centre, self.numbers):
            part.flags.writeable = False

    def __reduce__(self):
        parts = self.nodes, self.triangles, self.ids, self.centre, self.exponent, self.depth, self.has_origins
        return MeshTree, parts

    @property
    def content(self) -> bytes:
        if self._content is None:
            digest = hashlib.blake2b((self.triangles + 0.0).tobytes(), digest_size=16)
            digest.update(self.ids.tobytes())
            self._content = digest.digest()
        return self._content

    @property
    def places(self) -> np.ndarray:
        """(n,) int64: where each facet, by number, stands in the order of the leaves."""
        if self._places is None:
            places = np.empty(len(self.ids), dtype=np.int64)
            places[self.ids] = np.arange(len(places))
            self._places = places
        return self._places

    def need_slabs(self, make) -> None:
        """Make the slabs for distances (``make``: `bvh_slabs.make_slabs`), unless the tree has them."""
        if self._slabs is None:
            with _making():
                if self._slabs is None:
                    slabs = make(self)
                    self.header[SLABS_AT] = address_of(slabs)
                    self._slabs = slabs

    @property
    def nbytes(self) -> int:
        """Bytes of the tree, its triangles included."""
        parts = (self.nodes, self.triangles, self.ids, self.numbers, self.header, self._slabs, self._places)
        return sum(part.nbytes for part in parts if part is not None)

    def boxes(self, nodes=slice(None)) -> tuple[np.ndarray, np.ndarray]:
        """(centres, half lengths) of all nodes or of some, both (k, 8, 3) float64, in units, from the tree's centre."""
        floats = self.nodes[nodes, : 6 * WIDTH].view(np.float32).reshape(-1, 6, WIDTH).astype(np.float64)
        return floats[:, :3].transpose(0, 2, 1) + self.origins(nodes)[:, None], floats[:, 3:].transpose(0, 2, 1)

    def origins(self, nodes=slice(None)) -> np.ndarray:
        """(k, 3) what the boxes of all nodes or of some are relative to, in units, from the tree's centre."""
        words = self.nodes[nodes, 3 * WIDTH : 6 * WIDTH].reshape(-1, 3, WIDTH)
        if not self.has_origins:
            return np.zeros(words.shape[:2])
        low_bytes = (words[:, :, :4] & 0xFF).astype(np.uint8)
        return np.ascontiguousarray(low_bytes).view("<i4")[:, :, 0] * ORIGIN_STEP

    def links(self) -> np.ndarray:
        """(k, 8) links; those of unused slots are 0."""
        return self.nodes[:, 6 * WIDTH :]

    def used(self, nodes=slice(None)) -> np.ndarray:
        """(k, 8) whether a slot holds a box, of all nodes or of some."""
        return self.nodes[nodes, 3 * WIDTH : 4 * WIDTH].copy().view(np.float32) > NOTHING / 2

    def _radius(self) -> float:
        """Of a ball around the centre that holds the box of the whole mesh."""
        centres, half_lengths = self.boxes([0])
        return math.ldexp(math.hypot(*(abs(centres[0, 0]) + half_lengths[0, 0])), self.exponent) * (1 + 2.0**-50)

    def _check_structure(self) -> None:
        """Everything that a kernel relies on to stay inside the arrays and to come to an end."""
        m = len(self.ids)
        _require(self.nodes.ndim == 2 and self.nodes.shape[1] == NODE and len(self.nodes) > 0, "nodes of another shape")
        _require(self.triangles.shape == (m, 9) and 0 < m <= MAX_FACETS, "triangles of another shape")
        _require(self.centre.shape == (3,) and np.isfinite(self.centre).all(), "a centre that is none")
        links, used = self.links(), self.used()
        leaves = leaf_runs(links[used & (links < 0)])
        first, count = leaves
        _require((count >= 1).all() and (count <= MAX_LEAF).all(), "a leaf without triangles")
        order = np.argsort(first)
        ends = (first + count)[order]
        _require(first[order][0] == 0 and ends[-1] == m, "leaves that do not cover the triangles")
        _require(np.array_equal(first[order][1:], ends[:-1]), "leaves that do not follow one another")
        parents, slots = np.nonzero(used & (links >= 0))
        below = links[parents, slots]
        _require((below > parents).all() and (below < len(self.nodes)).all(), "a link that does not lead down")
        _require(len(np.unique(below)) == len(below) == len(self.nodes) - 1, "a node with two parents, or none")
        _require(used[0].sum() == 1, "a root of more than one box")
        _require(self.depth == _depth(parents, below, len(self.nodes)), "another depth than it says")


#: Held while slabs are made: one tree at a time.
_making = ForkSafeLock()


def _depth(parents: np.ndarray, below: np.ndarray, n: int) -> int:
    parent = np.zeros(n, dtype=np.int64)
    parent[below] = parents
    at, depth = np.arange(n), 1
    while at.any():
        at = parent[at]
        depth += 1
    return depth


class TreeView(NamedTuple):
    """A tree as kernels see it.

    header, numbers : as the constants above lay them out.
    boxes, links : the words of the nodes, as floats and as integers.
    triangles : nine doubles a facet, in the order of the leaves.   ids : the facets' numbers.
    """

    header: np.ndarray
    numbers: np.ndarray
    boxes: np.ndarray
    links: np.ndarray
    triangles: np.ndarray
    ids: np.ndarray


class Box(NamedTuple):
    """A box along the axes of its tree: centre and half lengths, in the tree's units, from the tree's centre."""

    centre: Vec3
    half: Vec3


@kernel(inline=True)
def open_tree(header_at):
    """The tree whose header stands at an address."""
    header = view_i64(header_at, INTS)
    return TreeView(
        header, view_f64(header[NUMBERS_AT], NUMBERS), view_f32(header[NODES_AT], NODE * header[N_NODES]),
        view_i32(header[NODES_AT], NODE * header[N_NODES]), view_f64(header[TRIANGLES_AT], 9 * header[N_FACETS]),
        view_i32(header[IDS_AT], header[N_FACETS]),
    )


@kernel(inline=True)
def float_column_at(values, at):
    """A vector whose components stand WIDTH floats apart: of a box, or of the normal of a slab."""
    return Vec3(float(values[at]), float(values[at + WIDTH]), float(values[at + 2 * WIDTH]))


@kernel(inline=True)
def box_at(tree, ref):
    """The box behind a reference, which is the number of its node times 8 plus its slot."""
    at = NODE * (ref >> 3) + (ref & 7)
    boxes = tree.boxes
    centre = Vec3(np.float64(boxes[at]), np.float64(boxes[at + WIDTH]), np.float64(boxes[at + 2 * WIDTH]))
    if tree.header[HAS_ORIGINS] != 0:
        centre = add(origin_of(tree.links, ref >> 3), centre)
    return Box(centre, float_column_at(tree.boxes, at + 3 * WIDTH))


@kernel
def origin_of(links, node):
    """What a node's boxes are relative to, from the tree's centre, in a tree that has origins."""
    at = NODE * node + 3 * WIDTH
    return Vec3(_number_in(links, at), _number_in(links, at + WIDTH), _number_in(links, at + 2 * WIDTH))


@kernel
def _number_in(words, at):
    """The number in the lowest bytes of four words."""
    number = 0
    for k in range(4):
        number |= (int(words[at + k]) & 0xFF) << (8 * k)
    return ORIGIN_STEP * (number - ((number >> 31) << 32))


@kernel(inline=True)
def box_size(boxes, ref):
    """Sum of the half lengths of the box behind a reference."""
    half = float_column_at(boxes, NODE * (ref >> 3) + (ref & 7) + 3 * WIDTH)
    return half.x + half.y + half.z


@kernel(inline=True)
def link_of(links, ref):
    """What is behind the box of a reference: a node (≥ 0) or a leaf (< 0)."""
    return int(links[NODE * (ref >> 3) + 6 * WIDTH + (ref & 7)])


@kernel
def leaf_link(first, count):
    """The link to triangles first … first + count − 1."""
    return ~((first << 3) | count)


def leaf_runs(links: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(first, count) of the triangles behind the links to leaves."""
    runs = ~np.asarray(links, dtype=np.int64)
    return runs >> 3, runs & 7


def _require(condition, what: str) -> None:
    if not condition:
        raise ValueError(f"mesh tree: {what}")
