"""Questions of `mesh_states.py`: how kernels ask each tested pair of bodies with a mesh, and on what they work."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.kernels import address_of, code_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.packed_convex import POINTS
from collide.lowering.parts import convex_set_of, is_single_convex
from collide.narrowphase.bounds import PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.dispatch import Method, method_of
from collide.robots import mesh_states as layout
from collide.robots.check_tables import RobotBody, Setting, without_meshes
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape

#: Objects whose questions are kept, at most.
_MAX_KNOWN = 64
#: Half of the engine, which robots without meshes never load.
facet_calls = lazy_module("collide.narrowphase.facets.facet_kernel_calls")
item_calls = lazy_module("collide.narrowphase.facets.nearest_item_calls")
facet_queries = lazy_module("collide.narrowphase.facets.facet_queries")
facet_bodies = lazy_module("collide.lowering.facet_bodies")
mesh_collide = lazy_module("collide.narrowphase.facets.mesh_collide_kernel")
mesh_distance = lazy_module("collide.narrowphase.facets.mesh_distance_kernel")


class MeshQuestions:
    """A thread's.   words : QUESTIONS + QUESTION · bodies · (around + bodies) int64."""

    def __init__(self, setting: Setting, part_rows: dict[int, int], workspace: tuple[int, int]):
        """part_rows : body around with one part → row of its pose.   workspace : doubles and integers of
        `answer_pairs`.
        """
        self._held: list[Any] = []
        #: Address of a header → the bodies of facets that it asks about, in the order of the question.
        self._asked: dict[int, tuple[Any, ...]] = {}
        self._of_meshes: dict[int, Any] = {}
        self._known: dict[tuple, tuple] = {}
        self._space, self._workspace, self._packed = facet_queries.Workspace(512), workspace, setting.table.packed[0]
        self._bodies = [_Asked.of(body) for body in setting.bodies[: setting.tables.n_bodies]]
        self._around = [
            (None if body.margin or k not in part_rows else _single(body.shape), part_rows.get(k, -1))
            for k, body in enumerate(setting.surroundings.bodies)
        ]
        n_bodies, n_around = len(setting.tables.bodies), len(self._around)
        self.words = np.zeros(layout.QUESTIONS + layout.QUESTION * n_bodies * (n_around + n_bodies), dtype=np.int64)
        self.words[: layout.QUESTIONS] = code_of(mesh_collide.meet_poses), code_of(mesh_distance.gap_poses), (
            n_around + n_bodies)
        self._table = self.words[layout.QUESTIONS :].reshape(n_bodies, n_around + n_bodies, layout.QUESTION)
        filters = setting.filters.of_first(0)
        for a, b in filters.self_pairs.tolist():
            self._table[a, n_around + b] = self._question_of(self._bodies[a], self._bodies[b])
        for a, asked in enumerate(self._bodies):
            self._table[a, :n_around] = self._questions_around(asked, filters.allowed[a])

    def carry(self, setting: Setting) -> bool:
        """Ask about attached objects, too; what is known of an object's shape is taken over. False, and nothing holds,
        once so many are known that all are to be made anew.
        """
        filters, n_around, bodies = setting.filters, len(self._around), self._bodies.copy()
        objects: tuple = ()
        ends = [*filters.starts[1:], len(filters.self_pairs)]
        for number, (rows, first, end) in enumerate(zip(setting.objects, filters.starts, ends), len(bodies)):
            others, allowed = filters.self_pairs[first:end, 0], filters.allowed[number]
            asked = _Asked.of(rows.body)
            bodies.append(asked)
            objects += (asked.key,)
            key = objects, others.tobytes(), allowed.tobytes()
            if key not in self._known:
                if len(self._known) >= _MAX_KNOWN:
                    return False
                column = np.zeros((len(self._table), layout.QUESTION), dtype=np.int64)
                for a in others.tolist():
                    column[a] = self._question_of(bodies[a], asked)
                self._known[key] = column, self._questions_around(asked, allowed), bodies
            self._table[:, n_around + number], self._table[number, :n_around], _ = self._known[key]
        return True

    def _question_of(self, A: _Asked, B: _Asked) -> tuple[int, int, int]:
        """That of two bodies of the robot: moving obstacles are asked with their padding, as obstacles are."""
        if A.is_obstacle or B.is_obstacle:
            return self._question(A.padded, B.padded, -1)
        return self._question(A.plain, B.plain, -1)

    def _questions_around(self, asked: _Asked, allowed: np.ndarray) -> np.ndarray:
        """(around, QUESTION) of a body of the robot."""
        out = np.zeros((len(self._around), layout.QUESTION), dtype=np.int64)
        for k in np.flatnonzero(allowed == 0).tolist():
            out[k] = self._question(asked.padded, *self._around[k])
        return out

    def _question(self, A: Single | None, B: Single | None, row: int) -> tuple[int, int, int]:
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
        return how, self._of_items(mesh), row

    def _of_items(self, mesh: Shape) -> int:
        """A question of the facets of a mesh, beside a part in whose place kernels write others."""
        if id(mesh) not in self._of_meshes:
            body = facet_bodies.body_of(mesh)
            made = item_calls.GapQuestion(item_calls.facets_of(body), self._packed, self._workspace)
            self._of_meshes[id(mesh)], self._asked[address_of(made.header)] = made, (body,)
        return address_of(self._of_meshes[id(mesh)].header)

    def _of_facets(self, A: Shape, B: Shape) -> int:
        bodies = facet_bodies.body_of(A), facet_bodies.body_of(B)
        pair = facet_calls.pair_of(*bodies)
        pair.need_slabs()
        n_stack = facet_queries.stack_of(pair.A.tree, pair.B.tree)
        if n_stack > self._space.n_stack:
            self._space = facet_queries.Workspace(n_stack)
        header = facet_calls.pair_header(pair.A, pair.B, pair.exchanged, self._space)
        self._held.append((pair, self._space, header))
        self._asked[address_of(header)] = bodies
        return address_of(header)

    def tables(self, n_bodies: int) -> dict[str, np.ndarray]:
        """The questions of the first bodies, and the bodies of facets, by name (`checker_file.py`).

        Of a question: how, the numbers of two bodies of facets or of a single body, and the row of a pose
        around.
        """
        bodies = [*{id(body): body for asked in self._asked.values() for body in asked}.values()]
        known = {id(body): k for k, body in enumerate(bodies)}
        table = self._table[:n_bodies, : len(self._around) + n_bodies]
        questions = np.full((*table.shape[:2], 4), -1, dtype=np.int64)
        questions[:, :, 0], questions[:, :, 3] = table[:, :, layout.HOW], table[:, :, layout.POSE_ROW]
        for a, b in np.argwhere(table[:, :, layout.HEADER_AT]).tolist():
            asked = self._asked[int(table[a, b, layout.HEADER_AT])]
            questions[a, b, 1 : 1 + len(asked)] = [known[id(body)] for body in asked]
        numbers = [PROMISE_STORED if self._packed.kind == POINTS else PROMISE_CURVED]
        for body in bodies:
            numbers += [body.radius, facet_bodies.reach_of(body)]
        return {"questions": questions, "facet_numbers": np.array(numbers), **_facets_of(bodies)}

    @staticmethod
    def no_tables() -> dict[str, np.ndarray]:
        """Empty tables of the same names."""
        names = ("questions", "facet_numbers", "facet_ints", "facet_vertices", "facet_faces")
        return dict.fromkeys(names, np.zeros(0))


def _facets_of(bodies: list) -> dict[str, np.ndarray]:
    """Vertices and faces of meshes, and points of hulls, for programs that make bodies of facets anew."""
    ints, vertices, faces = [], [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)]
    for body in bodies:
        is_mesh = isinstance(body.shape, Mesh)
        corners = body.shape.vertices if is_mesh else convex_set_of(body.shape).points
        triangles = body.shape.faces if is_mesh else faces[0]
        ints.append((is_mesh, len(corners), len(triangles), body.solid))
        vertices.append(corners)
        faces.append(triangles)
    return {
        "facet_ints": np.array(ints, dtype=np.int64), "facet_vertices": np.concatenate(vertices),
        "facet_faces": np.concatenate(faces),
    }


class Single(NamedTuple):
    """The only shape of a body.   is_given : whether the shape stands in the frame of the body; else its pose is a
    rounded product.
    """

    shape: Shape
    is_given: bool


class _Asked(NamedTuple):
    """A body of the robot by its only shape.   padded : the shape if the body has no padding."""

    plain: Single | None
    padded: Single | None
    is_obstacle: bool

    @classmethod
    def of(cls, body: RobotBody) -> _Asked:
        plain = _single(body.shape)
        return cls(plain, None if body.padding else plain, body.is_obstacle)

    @property
    def key(self) -> tuple | None:
        """By what it is known while its shape lives."""
        return self.plain and (id(self.plain.shape), self.plain.is_given, self.padded is None)


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
