"""A robot and its surroundings in the tables that kernels read: bodies, parts, boxes, filters.

Made once a checker and World; nothing here looks at a configuration.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from collide.broadphase.bounding_boxes import boxes_of
from collide.broadphase.box_tree import BoxTree
from collide.lowering.compound_table import PART, lay_out
from collide.lowering.extents import box_of
from collide.lowering.lazy_structures import may_have_tree, support_tree_of
from collide.lowering.packed_convex import HALFSPACE, POINTS, PackedConvex, pack_halfspace, pack_points
from collide.lowering.parts import Part, bounding_parts_of, parts_of
from collide.lowering.shape_table import POSE, POSE_STRETCH, POSE_TERMS, ShapeTable, pose_table
from collide.mesh.convex_surface import is_own_hull
from collide.narrowphase.posed_pair import LEAST_SQUARE
from collide.robots.check_scene import BODY_INTS, BOX, ROUNDINGS_OF_ROTATIONS, TWINS, UNBOUNDED_HALF
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh, corners_of_facets
from collide.shapes.shape import Shape, kept_with_shape

#: Boxes are moved outwards by this share of all that went into them, far more than roundings are.
_LEAST_SLACK = 2.0**-40
#: Tables of shapes with attached objects that are kept with the tables of a setting, at most.
_MAX_JOINED = 8


class RobotBody(NamedTuple):
    """A body of the robot, moving with a link.

    name : of the link, or of the attached object.   link : number of the link.   shape : in the link's frame.
    padding : swelling against the surroundings [m].   is_obstacle : of the surroundings, and moves along.
    """

    name: str
    link: int
    shape: Shape
    padding: float
    is_obstacle: bool = False


class BodyAround(NamedTuple):
    """A body of the surroundings.   X_WB : (4, 4).   margin : swelling against the robot [m].   row : of its pose among
    those of the World's bodies.
    """

    name: str
    shape: Shape
    X_WB: np.ndarray
    margin: float = 0.0
    row: int = 0


class MovedBodies(Sequence):
    """Bodies around at other poses.   X_WBs : (n, 4, 4) of the World's bodies."""

    def __init__(self, bodies: Sequence[BodyAround], X_WBs: np.ndarray):
        self._bodies: Sequence[BodyAround] = bodies._bodies if isinstance(bodies, MovedBodies) else bodies
        self._X_WBs = X_WBs

    def __len__(self) -> int:
        return len(self._bodies)

    def __getitem__(self, k):
        if isinstance(k, slice):
            return [self[j] for j in range(*k.indices(len(self)))]
        body = self._bodies[k]
        return body._replace(X_WB=self._X_WBs[body.row])


class Surroundings(NamedTuple):
    """The surroundings' part of `CheckTables`.

    bodies : by number.   packed : of the parts.   body_of : (parts,) int64.   is_bound : (parts,) bool.
    table : of the parts.   X_BP : (parts, 4, 4).   rows : (parts,) int64, of the parts' bodies among the World's.
    has_margins, has_fields : whether a body is swollen, and whether a body is a field.
    poses : (parts, POSE).   tree : over the parts.   Both are of when the tables were made: a `CheckWorkspace` has them
        as the bodies stand.
    """

    bodies: Sequence[BodyAround]
    packed: list[PackedConvex]
    poses: np.ndarray
    body_of: np.ndarray
    is_bound: np.ndarray
    tree: BoxTree | None
    table: ShapeTable
    X_BP: np.ndarray
    rows: np.ndarray
    has_margins: bool
    has_fields: bool


class SpareRows(NamedTuple):
    """How many bodies, parts and spheres of attached objects tables have rows for."""

    bodies: int
    parts: int
    spheres: int

    def holds(self, objects: Sequence[Any]) -> bool:
        """Whether objects fit in."""
        bodies, parts, spheres = _needed(objects)
        return bodies <= self.bodies and parts <= self.parts and spheres <= self.spheres

    @classmethod
    def of(cls, objects: Sequence[Any]) -> SpareRows:
        """Rows for objects, and for as many again."""
        return cls(*(max(least, 2 * needed) for least, needed in zip((4, 16, 64), _needed(objects))))


def _needed(objects: Sequence[Any]) -> tuple[int, int, int]:
    parts = sum([rows.n_parts for rows in objects])
    return len(objects), parts, sum([len(rows.spheres.rows) for rows in objects if rows.spheres is not None])


class CheckTables(NamedTuple):
    """Tables constant between configurations. Behind the rows of links are rows for attached objects: each
    `CheckWorkspace` writes into its copies what a setting has attached.

    bodies : (n, BODY_INTS) int64.   body_boxes : (n, BOX), in their links.   parts : (twins of) parts in their links.
    padded : offset from a part's number to the number of its padded twin, 0 without padding.
    part_boxes : (all parts, BOX), in their own frames.   is_bound : (all parts,) uint8.
    table, shape_of : shapes of all parts.   poses : (all parts, POSE), written of the surroundings.
    slack : share by which boxes are moved outwards.
    n_bodies, n_parts : of links, without twins.   spare_rows : for attached objects.   joined : {ids of the convex
        sets of attached objects: table of shapes with these behind}.
    """

    bodies: np.ndarray
    body_boxes: np.ndarray
    parts: np.ndarray
    padded: int
    part_boxes: np.ndarray
    is_bound: np.ndarray
    table: ShapeTable
    shape_of: np.ndarray
    poses: np.ndarray
    slack: float
    n_bodies: int
    n_parts: int
    spare_rows: SpareRows
    joined: dict[tuple[int, ...], ShapeTable]

    def table_with(self, objects: Sequence[Any]) -> ShapeTable:
        """The table of shapes, with those of attached objects behind: of each the parts, then their twins."""
        packed = [part for rows in objects for part in rows.tables.table.packed]
        if not packed:
            return self.table
        key = tuple(map(id, packed))  # the sets are in the table that is kept, so that ids stay theirs
        table = self.joined.get(key)
        if table is None:
            table = self.table.copied()
            table.append(packed)
            table.build_trees(np.arange(len(self.table.packed), len(table.packed)))
            if len(self.joined) >= _MAX_JOINED:
                self.joined.clear()
            self.joined[key] = table
        return table


class RobotTables(NamedTuple):
    """The links' part of `CheckTables`, constant while the World changes, or an attached object's.

    is_padded : whether twins of all parts stand behind the parts.   skew : of all matrices.
    """

    bodies: np.ndarray
    body_boxes: np.ndarray
    parts: np.ndarray
    is_padded: bool
    part_boxes: np.ndarray
    is_bound: np.ndarray
    table: ShapeTable
    skew: float


class Setting(NamedTuple):
    """A robot among the bodies of a World at a moment.

    bodies : of the robot: links, then attached objects.   base : pose of the root, as `forward_kinematics.LINK_POSE`
        doubles.
    objects, table : attached objects, and `CheckTables.table_with` these.
    rules, filters : `robot_bodies.PairRules` and `Filters`: pairs never tested, and tested pairs.
    spheres, maps : of the robot's links, and of the first of the tested pairs of bodies, or ``None``.
    seen : the World as of then.   made_of : the World as of when the tables were made.   spare : workspaces of threads
        not at work, shared with settings of the same tables.
    """

    bodies: Sequence[RobotBody]
    base: np.ndarray
    surroundings: Surroundings
    tables: CheckTables
    objects: tuple[Any, ...]
    table: ShapeTable
    rules: Any
    filters: Any
    spheres: Any
    maps: Any
    seen: Any
    made_of: Any
    spare: list[Any]

    @property
    def self_pairs(self) -> np.ndarray:
        """(k, 2) int64 of tested bodies."""
        return self.filters.self_pairs

    @property
    def body_boxes(self) -> np.ndarray:
        """(bodies, BOX) in their links."""
        of_links = self.tables.body_boxes[: self.tables.n_bodies]
        return np.concatenate([of_links, *(rows.tables.body_boxes for rows in self.objects)])

    @property
    def allowed(self) -> np.ndarray:
        """(bodies, around) uint8, 1 for pairs never tested."""
        return self.filters.allowed


class _LinkParts(NamedTuple):
    parts: list[Part]
    is_bound: bool


def surroundings_of(bodies: Sequence[BodyAround], before: Surroundings | None = None) -> Surroundings:
    """Parts of the bodies around, posed, and a tree over them.

    before : surroundings whose parts are taken over where bodies have at most moved.
    """
    if before is not None and _have_at_most_moved(before.bodies, bodies):
        _, packed, _, body_of, is_bound, _, table, X_BP, *_ = before
        poses = _poses_of(bodies, body_of, X_BP, packed)
    else:
        of_bodies = [convex_parts_of(body.shape) for body in bodies]
        counts = np.array([len(of_body.parts) for of_body in of_bodies], dtype=np.int64)
        body_of = np.repeat(np.arange(len(bodies)), counts)
        packed = [packed for of_body in of_bodies for packed, _ in of_body.parts]
        is_bound = np.repeat(np.array([of_body.is_bound for of_body in of_bodies], dtype=bool), counts)
        X_BP = np.array([X for of_body in of_bodies for _, X in of_body.parts]).reshape(-1, 4, 4)
        poses = _poses_of(bodies, body_of, X_BP, packed)
        margins = np.repeat([body.margin for body in bodies], counts)
        for k in np.flatnonzero(margins).tolist():
            packed[k] = packed_within(packed[k], float(margins[k]), poses[k, :9].reshape(3, 3))
        table = ShapeTable(packed)
    tree = BoxTree(boxes_of(table, poses, np.arange(len(packed)))) if packed else None
    rows = np.array([body.row for body in bodies], dtype=np.int64)[body_of]
    has_margins, has_fields = any(body.margin != 0.0 for body in bodies), any(body.shape.is_field for body in bodies)
    return Surroundings(bodies, packed, poses, body_of, is_bound, tree, table, X_BP, rows, has_margins, has_fields)


def _have_at_most_moved(before: Sequence[BodyAround], now: Sequence[BodyAround]) -> bool:
    """Whether all shapes are the same; False with margins, which swell parts by how their bodies are turned."""
    return len(before) == len(now) and all(
        a.shape is b.shape and a.margin == b.margin == 0.0 for a, b in zip(before, now)
    )


def _poses_of(
    bodies: Sequence[BodyAround], body_of: np.ndarray, X_BP: np.ndarray, packed: Sequence[PackedConvex]
) -> np.ndarray:
    """(parts, POSE) rows of parts in the world."""
    X_WB = np.array([body.X_WB for body in bodies]).reshape(-1, 4, 4)[body_of]
    poses = pose_table(X_WB, X_BP, np.array([part.reach for part in packed]), terms=False).rows
    poses[:, POSE_TERMS] = -1.0  # what products of poses lost is in their slop
    poses[:, POSE_STRETCH] = _stretches(poses)
    return poses


def check_tables(bodies: Sequence[RobotBody], around: Surroundings, matrices: np.ndarray) -> CheckTables:
    """The `CheckTables` of a robot's bodies and what is around them; arguments as of `robot_tables`."""
    return tables_among(robot_tables(bodies, matrices), around, SpareRows(0, 0, 0))


def robot_tables(bodies: Sequence[RobotBody], matrices: np.ndarray, *, is_padded: bool = False) -> RobotTables:
    """Tables of a robot's bodies.   matrices : (k, 3, 3) every matrix that poses of links are products of.
    is_padded : whether parts have twins where no body is swollen, as well.
    """
    of_bodies = [convex_parts_of(body.shape) for body in bodies]
    counts = np.array([len(of_body.parts) for of_body in of_bodies], dtype=np.int64)
    rows = np.zeros((len(bodies), BODY_INTS), dtype=np.int64)
    rows[:, 0], rows[:, 1], rows[:, 2] = [body.link for body in bodies], np.cumsum(counts) - counts, counts
    packed = [packed for of_body in of_bodies for packed, _ in of_body.parts]
    parts = np.concatenate([np.zeros((0, PART)), *(lay_out(of_body.parts).parts for of_body in of_bodies)])
    is_bound = np.repeat(np.array([of_body.is_bound for of_body in of_bodies], dtype=bool), counts)
    padding = np.repeat(np.array([body.padding for body in bodies]), counts)
    is_padded = is_padded or bool(padding.any())
    padded = len(packed) if is_padded else 0
    rows[:, TWINS] = [padded if body.is_obstacle else 0 for body in bodies]
    if is_padded:
        packed = packed + [swollen(part, by) for part, by in zip(packed, padding.tolist())]
        parts, is_bound = np.concatenate([parts, parts]), np.concatenate([is_bound, is_bound])
    table = ShapeTable(packed)
    table.build_trees(np.arange(len(packed)))  # else each support of a hull looks at all its vertices
    part_boxes = np.array([box_of(part) for part in packed]).reshape(-1, BOX)
    return RobotTables(
        rows, _body_boxes(rows, parts, part_boxes, padded), parts, is_padded, part_boxes, is_bound, table,
        float(_skew(matrices).sum() + _skew(parts[:, :9].reshape(-1, 3, 3)).max(initial=0.0)),
    )


def tables_among(
    robot: RobotTables, around: Surroundings, spare: SpareRows, before: Setting | None = None
) -> CheckTables:
    """The `CheckTables` of a robot among surroundings, with spare rows for attached objects.

    before : a setting of the robot, whose tables of shapes are taken over where the surroundings have the same.
    """
    n_parts = len(robot.parts) // 2 if robot.is_padded else len(robot.parts)

    def with_spare(rows: np.ndarray) -> np.ndarray:
        both, empty = [rows[:n_parts], rows[n_parts:]], np.zeros((spare.parts, *rows.shape[1:]), dtype=rows.dtype)
        return np.concatenate([both[0], empty, both[1], empty] if robot.is_padded else [both[0], empty])

    poses = np.concatenate([with_spare(np.zeros((len(robot.parts), POSE))), around.poses])
    slack = _LEAST_SLACK + 8.0 * (robot.skew + _skew(around.poses[:, :9].reshape(-1, 3, 3)).max(initial=0.0))
    if before is not None and before.surroundings.table is around.table:
        return before.tables._replace(poses=poses, slack=slack)
    table = robot.table.copied()
    table.append(around.packed)
    table.build_trees(np.arange(len(table.packed)))
    bodies = np.concatenate([robot.bodies, np.zeros((spare.bodies, BODY_INTS), dtype=np.int64)])
    bodies[:, TWINS] += spare.parts * (bodies[:, TWINS] > 0)
    shape_of = np.arange(len(table.packed))
    return CheckTables(
        bodies, np.concatenate([robot.body_boxes, np.zeros((spare.bodies, BOX))]), with_spare(robot.parts),
        n_parts + spare.parts if robot.is_padded else 0,
        np.concatenate([with_spare(robot.part_boxes), *(box_of(part)[None] for part in around.packed)]),
        np.concatenate([with_spare(robot.is_bound), around.is_bound]).astype(np.uint8), table,
        np.concatenate([with_spare(shape_of[: len(robot.parts)]), shape_of[len(robot.parts) :]]), poses, slack,
        len(robot.bodies), n_parts, spare, {},
    )


@kept_with_shape("_convex_parts")
def convex_parts_of(shape: Shape) -> _LinkParts:
    """The convex parts of a shape; with ``is_bound`` parts around a mesh that is not convex.

    A solid mesh equal to its own convex hull is read as the hull.
    """
    same = without_meshes(shape)
    return _LinkParts(list(bounding_parts_of(shape) if same is None else parts_of(same)), same is None)


def without_meshes(shape: Shape) -> Shape | None:
    """A shape of convex parts, the same set as the shape; ``None`` for a mesh that is not its own hull."""
    return _hulls_instead(shape) if shape.is_asked_whole else shape


@kept_with_shape("_hulls_instead")
def _hulls_instead(shape: Shape) -> Shape | None:
    if isinstance(shape, Mesh) and shape.meshed and shape.solid and is_own_hull(shape.vertices, shape.faces):
        return ConvexHull(corners_of_facets(shape))
    if not isinstance(shape, Compound):
        return None
    items = [(without_meshes(item), X) for item, X in shape.items]
    return None if any(item is None for item, _ in items) else Compound(items)


def swollen(packed: PackedConvex, by: float) -> PackedConvex:
    """A convex set swollen by a ball of radius ``by`` [m]."""
    if packed.kind == POINTS:
        wider = pack_points(packed.points, packed.radius + by, packed.slop, packed.prepared.with_tree)
        if may_have_tree(packed):  # of the same points: one tree serves both, however often margins change
            wider.prepared.made["tree"] = support_tree_of(packed)
        return wider
    radius = packed.radius + by
    return packed._replace(radius=radius, content=packed.content + np.float64(radius).tobytes())


def packed_within(packed: PackedConvex, margin: float, R: np.ndarray) -> PackedConvex:
    """A convex set, turned by R (3, 3) and swollen by a margin in the world [m]; the slop of the result bounds the
    rounding of both [m].
    """
    if packed.kind == HALFSPACE:
        normal, offset = packed.params[:3], float(packed.params[3])
        # Planes n·x = c are taken to n'·y = c + n'·t with n' = n R⁻¹: offsets differ by |n'| for each unit of length.
        unit = float(np.linalg.norm(np.linalg.solve(R.T, normal)))
        rounding = 2.0**-48 * (margin + abs(offset) / unit)
        return pack_halfspace(normal, offset + margin * unit)._replace(slop=packed.slop + rounding)
    radius = packed.radius + margin
    back = radius - packed.radius
    rounding = abs(packed.radius - (radius - back)) + abs(margin - back)  # of the sum, to the last digit
    return swollen(packed, margin)._replace(slop=packed.slop + rounding)


def _body_boxes(rows: np.ndarray, parts: np.ndarray, part_boxes: np.ndarray, padded: int) -> np.ndarray:
    """(n, BOX) boxes of bodies in their links, around the padded parts where a body has any; an unbounded body has half
    sides of UNBOUNDED_HALF.
    """
    out = np.empty((len(rows), BOX))
    for k, (_, first, count, _) in enumerate(rows.tolist()):
        which = slice(first + padded, first + padded + count)
        if np.isinf(part_boxes[which]).any():
            out[k] = 0.0, 0.0, 0.0, UNBOUNDED_HALF, UNBOUNDED_HALF, UNBOUNDED_HALF
            continue
        R, t = parts[which, :9].reshape(-1, 3, 3), parts[which, 9:12]
        centre = (R @ part_boxes[which, :3, None])[:, :, 0] + t
        half = (np.abs(R) @ part_boxes[which, 3:, None])[:, :, 0]
        low, high = (centre - half).min(axis=0), (centre + half).max(axis=0)
        out[k] = *(0.5 * (low + high)), *(0.5 * (high - low))
    return out


def _stretches(poses: np.ndarray) -> np.ndarray:
    """(k,) `posed_pair.stretch_of_pose` of each, number by number."""
    x, y, z = (poses[:, axis:9:3] for axis in range(3))
    xx, yy, zz, xy, yz, zx = (
        np.abs(u[:, 0] * v[:, 0] + u[:, 1] * v[:, 1] + u[:, 2] * v[:, 2])
        for u, v in ((x, x), (y, y), (z, z), (x, y), (y, z), (z, x))
    )
    return np.sqrt(np.maximum.reduce([xx + xy + zx, yy + xy + yz, zz + yz + zx, np.full(len(x), LEAST_SQUARE)]))


def _skew(R: np.ndarray) -> np.ndarray:
    """(k,) how far matrices are from rotations; roundings of rotations count as none. Matrices within the tolerance of
    rotations are used as they are: boxes are off by a share in proportion.
    """
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).sum(axis=(1, 2))
    return np.where(off < ROUNDINGS_OF_ROTATIONS, 0.0, off)

