"""Questions of `mesh_states.py`: how kernels ask each tested pair of bodies with a mesh, and on what they work."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.kernels import address_of, code_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.parts import is_single_convex
from collide.narrowphase.dispatch import Method, method_of
from collide.robots import mesh_states as layout
from collide.robots.check_tables import Setting, without_meshes
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape

#: Half of the engine, which robots without meshes never load.
facet_calls = lazy_module("collide.narrowphase.facets.facet_kernel_calls")
item_calls = lazy_module("collide.narrowphase.facets.nearest_item_calls")
facet_queries = lazy_module("collide.narrowphase.facets.facet_queries")
facet_bodies = lazy_module("collide.lowering.facet_bodies")
mesh_collide = lazy_module("collide.narrowphase.facets.mesh_collide_kernel")
mesh_distance = lazy_module("collide.narrowphase.facets.mesh_distance_kernel")


class MeshQuestions:
    """A thread's.   words : QUESTIONS + QUESTION · bodies · (bodies + around) int64."""

    def __init__(self, setting: Setting, part_rows: dict[int, int], workspace: tuple[int, int]):
        """part_rows : body around with one part → row of its pose.   workspace : doubles and integers of
        `answer_pairs`.
        """
        self._held: list[Any] = []
        self._of_meshes: dict[int, Any] = {}
        self._space = facet_queries.Workspace(512)
        bodies, around = setting.bodies, setting.surroundings.bodies
        unpadded = [_single(body.shape) for body in bodies]
        of_bodies = [None if body.padding else shape for body, shape in zip(bodies, unpadded)]
        of_around = [
            None if body.margin or k not in part_rows else _single(body.shape) for k, body in enumerate(around)
        ]
        shape = len(bodies), len(bodies) + len(around), layout.QUESTION
        table = np.zeros(shape, dtype=np.int64)
        for a, b in setting.self_pairs.tolist():
            # Moving obstacles are asked with their padding, as obstacles are.
            shapes = of_bodies if bodies[a].is_obstacle or bodies[b].is_obstacle else unpadded
            table[a, b] = self._question(shapes[a], shapes[b], -1, setting, workspace)
        for a, b in np.argwhere(setting.allowed == 0).tolist():
            row = part_rows.get(b, -1)
            table[a, len(bodies) + b] = self._question(of_bodies[a], of_around[b], row, setting, workspace)
        codes = [code_of(mesh_collide.meet_poses), code_of(mesh_distance.gap_poses)]
        self.words = np.concatenate([np.array(codes, dtype=np.int64), table.ravel()])

    def _question(
        self, A: Single | None, B: Single | None, row: int, setting: Setting, workspace: tuple[int, int]
    ) -> tuple[int, int, int]:
        """(how, header, row of poses) of a pair; UNKNOWN of pairs without a mesh, and of pairs that others answer."""
        if A is None or B is None or not (_is_mesh(A.shape) or _is_mesh(B.shape)):
            return layout.UNKNOWN, 0, row
        method = method_of(kind_of(A.shape), kind_of(B.shape))
        if method is Method.HULL:
            return layout.HULLS, 0, row
        if A.is_given and B.is_given and method is Method.FACETS:
            return layout.FACETS, self._of_facets(A.shape, B.shape), row
        is_body = _is_mesh(A.shape)
        mesh, partner = (A.shape, B.shape) if is_body else (B.shape, A.shape)
        if partner.is_asked_whole or not is_single_convex(partner):  # its part only holds it
            return layout.UNKNOWN, 0, row
        how = layout.FACETS_OF_BODY if is_body else layout.FACETS_OF_PARTNER
        return how, self._of_items(mesh, setting, workspace), row

    def _of_items(self, mesh: Shape, setting: Setting, workspace: tuple[int, int]) -> int:
        """A question of the facets of a mesh, beside a part in whose place kernels write others."""
        if id(mesh) not in self._of_meshes:
            items, packed = item_calls.facets_of(facet_bodies.body_of(mesh)), setting.tables.table.packed[0]
            self._of_meshes[id(mesh)] = item_calls.GapQuestion(items, packed, workspace)
        return address_of(self._of_meshes[id(mesh)].header)

    def _of_facets(self, A: Shape, B: Shape) -> int:
        pair = facet_calls.pair_of(facet_bodies.body_of(A), facet_bodies.body_of(B))
        pair.need_slabs()
        n_stack = facet_queries.stack_of(pair.A.tree, pair.B.tree)
        if n_stack > self._space.n_stack:
            self._space = facet_queries.Workspace(n_stack)
        header = facet_calls.pair_header(pair.A, pair.B, pair.exchanged, self._space)
        self._held.append((pair, self._space, header))
        return address_of(header)


class Single(NamedTuple):
    """The only shape of a body.   is_given : whether the shape stands in the frame of the body; else its pose is a
    rounded product.
    """

    shape: Shape
    is_given: bool


def _single(shape: Shape) -> Single | None:
    """The only convex shape of a body, wherever it stands, or a mesh in the frame of the body; else ``None``."""
    is_given = True
    while isinstance(shape, Compound):
        if len(shape.items) != 1:
            return None
        is_given = is_given and bool((shape.items[0][1] == np.eye(4)).all())
        shape = shape.items[0][0]
    return Single(shape, is_given) if is_given or not shape.is_asked_whole else None


def _is_mesh(shape: Shape) -> bool:
    return isinstance(shape, Mesh) and without_meshes(shape) is None
