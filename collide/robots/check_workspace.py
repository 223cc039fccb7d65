"""Buffers of a thread's kernels for checking a robot, and the headers with the addresses of these buffers."""

from __future__ import annotations

import functools

import numpy as np

from collide.kernels import address_of, code_of
from collide.kernels.lanes import LANES
from collide.lowering.shape_table import NO_TERMS, POSE
from collide.narrowphase.facets.nearest_item_kernel import gap_of_part, state_of_part
from collide.narrowphase.pair_kernel import DOUBLES, INTEGERS, answer_pairs
from collide.results import PAIR_DTYPE
from collide.robots import check_scene as layout
from collide.robots import motion_bounds as motions
from collide.robots.bounding_spheres import SphereWorkspace
from collide.robots.check_scene import UNBOUNDED_HALF
from collide.robots.check_tables import Setting, Surroundings
from collide.robots.field_walks import field_walks
from collide.robots.mesh_questions import MeshQuestions
from collide.robots.move_surroundings import FIELD_MOVED, SKEWED, move_surroundings
from collide.robots.robot import Robot
from collide.robots.robot_bodies import Filters, paths_to_root
from collide.robots.sample_motions import OPEN_SAMPLE

#: Pairs left to others that a call has space for, at least.
_LEAST_OPEN = 4096
#: Pairs of parts that may stay open at once while a motion is halved, at most.
_MAX_ITEMS = 1 << 20
_OPEN_INTERVALS = 4096


class CheckWorkspace:
    """One thread's buffers, the surroundings as they stand for its questions, and rows of attached objects.

    setting : as of the last `stand`.   header, address : of `check_scene.py`.   open_pairs : (k, OPEN_INTS) what the
    last call left to others.   slots : buffers of searches for distances, by their kind.
    """

    def __init__(self, robot: Robot, setting: Setting):
        self.robot, self.setting = robot, _without_spares(setting)  # kernels read what they hold
        self.slots: dict = {}
        tables, around, joints = setting.tables, setting.surroundings, robot.joint_table
        n_bodies, n_parts, n_around = len(tables.bodies), len(tables.poses), len(around.packed)
        nothing, tree = np.zeros(1, dtype=np.int64), around.tree
        unbounded = np.ascontiguousarray(tree.unbounded, dtype=np.int64) if tree is not None else nothing[:0]
        n_link_parts = n_parts - n_around
        # One configuration leaves each pair of parts to others at most once.
        capacity = max(_LEAST_OPEN, n_link_parts * (n_around + n_link_parts) + 1)
        self._open = np.empty((capacity, layout.OPEN_INTS), dtype=np.int64)
        self._seen, self._rows, self._boxes = setting.made_of, around.rows, _boxes_around(around)
        self._rows_at, self._boxes_at = address_of(self._rows), address_of(self._boxes)
        # Behind links are rows for attached objects.
        self._bodies, self._body_boxes, self._parts, self._part_boxes, self._is_bound, self._shape_of = (
            table.copy() for table in (
                tables.bodies, tables.body_boxes, tables.parts, tables.part_boxes, tables.is_bound, tables.shape_of))
        self._buffers = buffers = {
            layout.POSES_AT: tables.poses.copy(), layout.LINKS_AT: np.zeros((joints.n_links, POSE)),
            layout.WORLD_BOXES_AT: np.zeros((n_bodies, layout.BOX)),
            layout.PLACED_AT: np.zeros(n_parts, dtype=np.int64),
            layout.CANDIDATES_AT: np.zeros(n_parts + 1, dtype=np.int64), layout.PAIR_AT: np.zeros(2, dtype=np.int64),
            layout.MESH_POSES_AT: np.zeros((2, 16)), layout.MESH_ROW_AT: np.zeros(2, dtype=PAIR_DTYPE),
            layout.ROW_AT: np.zeros(1, dtype=PAIR_DTYPE), layout.DOUBLES_AT: np.zeros(DOUBLES),
            layout.INTEGERS_AT: np.zeros(INTEGERS, dtype=np.int64), layout.OPEN_AT: self._open,
            layout.JOINT_INTS_AT: joints.ints, layout.JOINT_DOUBLES_AT: joints.doubles, layout.BASE_AT: setting.base,
            layout.BODIES_AT: self._bodies, layout.BODY_BOXES_AT: self._body_boxes, layout.PARTS_AT: self._parts,
            layout.PART_BOXES_AT: self._part_boxes, layout.IS_BOUND_AT: self._is_bound,
            layout.UNBOUNDED_AT: unbounded, layout.BODY_OF_AT: around.body_of, layout.PART_POSES_AT: around.X_BP,
            layout.TERMS_AT: NO_TERMS, layout.SHAPE_OF_AT: self._shape_of,
        }
        numbers = {
            layout.N_JOINTS: len(joints.ints), layout.ROOT: joints.root, layout.N_LINKS: joints.n_links,
            layout.CORE: code_of(answer_pairs), layout.STATE_OF_PART: code_of(state_of_part),
            layout.GAP_OF_PART: code_of(gap_of_part), layout.N_LINK_PARTS: n_link_parts,
            layout.PADDED: tables.padded, layout.N_PARTS: n_parts, layout.N_UNBOUNDED: len(unbounded),
            layout.N_AROUND: setting.allowed.shape[1], layout.OPEN_CAPACITY: capacity,
        }
        if tree is not None:
            nodes = tree.nodes[: tree.n_nodes].copy()
            buffers |= {layout.NODES_AT: nodes, layout.NODE_LINKS_AT: tree.links}
            numbers |= {layout.N_NODES: tree.n_nodes}
        self.header = np.zeros(layout.HEADER, dtype=np.int64)
        for word, number in numbers.items():
            self.header[word] = number
        for word, buffer in buffers.items():
            self.header[word] = address_of(buffer)
        self.address = address_of(self.header)
        self.verdict = bytearray(1)  # of a single configuration
        self.verdict_at = address_of(np.frombuffer(self.verdict, dtype=np.uint8))
        self._spheres: SphereWorkspace | None = None
        self._motions: MotionWorkspace | None = None
        self._meshes: MeshQuestions | None = None
        self._walk_fields(setting)
        self._carry(setting)
        self.stand(setting)

    def _carry(self, setting: Setting) -> None:
        """Take over attached objects and tested pairs. O(parts of objects)."""
        self.setting, tables, header = _without_spares(setting), setting.tables, self.header
        first, shape, skew = tables.n_parts, len(tables.table.packed), 0.0
        for number, rows in enumerate(setting.objects, tables.n_bodies):
            made, n = rows.tables, rows.n_parts
            self._bodies[number], self._body_boxes[number] = (rows.body.link, first, n, 0), made.body_boxes[0]
            for k in range(0, len(made.parts), n):  # parts, then their twins
                to = first if k == 0 else first + tables.padded
                some, of = slice(to, to + n), slice(k, k + n)
                self._parts[some], self._part_boxes[some] = made.parts[of], made.part_boxes[of]
                self._is_bound[some], self._shape_of[some] = made.is_bound[of], range(shape, shape + n)
                shape += n
            first, skew = first + n, max(skew, made.skew)
        header[layout.N_BODIES], header[layout.N_SELF_PAIRS] = len(setting.bodies), len(setting.self_pairs)
        header[layout.SELF_PAIRS_AT] = address_of(setting.self_pairs)
        header[layout.ALLOWED_AT] = address_of(setting.allowed)
        header[layout.INTS_AT], header[layout.NUMBERS_AT] = setting.table.addresses
        header[layout.SLACK : layout.SLACK + 1].view(np.float64)[:] = tables.slack + 8.0 * skew
        self.slots.clear()
        header[layout.SPHERE_HEADER_AT] = 0
        if setting.spheres is not None:
            if self._spheres is None:
                self._spheres = SphereWorkspace(self.robot, setting, setting.spheres)
            self._spheres.carry(setting)
            header[layout.SPHERE_HEADER_AT] = self._spheres.address
        if self._meshes is not None and not self._meshes.carry(setting):
            self._meshes, header[layout.MESH_QUESTIONS_AT] = None, 0

    def _walk_fields(self, setting: Setting) -> None:
        """Questions about fields around, where they stand."""
        workspace = (address_of(self._buffers[layout.DOUBLES_AT]), address_of(self._buffers[layout.INTEGERS_AT]))
        self._walks = field_walks(setting.surroundings, *workspace)
        self.header[layout.WALKS_AT] = address_of(self._walks.words)

    def stand(self, setting: Setting) -> bool:
        """Bring the surroundings to where a setting of the same tables has them, and take over what the setting has
        attached: O(parts) comparisons, O(nodes) where a body has moved. False, and nothing is done, where the matrix of
        a body that has moved is not a rotation.
        """
        if setting.seen is not self._seen:
            moved = self.follow(setting.seen)
            if moved == SKEWED:
                return False
            if moved == FIELD_MOVED:
                self._walk_fields(setting)
        before, self.setting = self.setting, _without_spares(setting)
        if setting.filters is not before.filters or setting.maps is not before.maps:
            self._carry(setting)
        return True

    def follow(self, seen) -> int:
        """Bring the surroundings to the poses ``seen.X_WBs``, unless the matrix of a moved body is not a rotation
        (SKEWED). FIELD_MOVED where walks of fields have to follow."""
        moved = move_surroundings(
            self.address, address_of(seen.X_WBs), address_of(self._seen.X_WBs), self._rows_at, self._boxes_at
        )
        if moved != SKEWED:
            self._seen = seen
        return moved

    def stands_at(self, setting: Setting) -> bool:
        """Whether there is nothing for `stand` to do."""
        mine = self.setting
        return mine.seen is setting.seen and mine.filters is setting.filters and mine.maps is setting.maps

    def tables(self) -> dict[str, np.ndarray]:
        """Tables of robot and surroundings as kernels read them, by name (`checker_file.py`)."""
        setting, buffers, n = self.setting, self._buffers, len(self.setting.bodies)
        n_link_parts, nodes = int(self.header[layout.N_LINK_PARTS]), int(self.header[layout.N_NODES])
        return {
            "bodies": self._bodies[:n], "body_boxes": self._body_boxes[:n], "parts": self._parts,
            "part_boxes": self._part_boxes, "is_bound": self._is_bound, "shape_of": self._shape_of,
            "poses": buffers[layout.POSES_AT][n_link_parts:], "part_poses": buffers[layout.PART_POSES_AT],
            "body_of": buffers[layout.BODY_OF_AT], "self_pairs": setting.self_pairs, "allowed": setting.allowed,
            "nodes": buffers[layout.NODES_AT] if nodes else np.zeros(0),
            "node_links": buffers[layout.NODE_LINKS_AT][:nodes] if nodes else np.zeros(0),
            "unbounded": buffers[layout.UNBOUNDED_AT],
        }

    def sphere_tables(self) -> dict[str, np.ndarray]:
        """Those of `SphereWorkspace.tables`, empty without spheres."""
        if self._spheres is None:
            return SphereWorkspace.no_tables()
        return self._spheres.tables(self.setting)

    def mesh_tables(self) -> dict[str, np.ndarray]:
        """Those of `MeshQuestions.tables`, empty where nothing is asked about meshes."""
        self.ask_meshes(self.setting)
        if self._meshes is None:
            return MeshQuestions.no_tables()
        return self._meshes.tables(len(self.setting.bodies))

    def motions(self, resolution: float) -> MotionWorkspace:
        """The workspace of `certify_motions`, for this resolution [rad or m]."""
        if self._motions is None:
            self._motions = MotionWorkspace(self.robot, self.setting)
        self._motions.carry(self._bodies, self.setting)
        self._motions.begin(resolution)
        return self._motions

    def ask_meshes(self, setting: Setting) -> None:
        """Have kernels ask about meshes themselves; trees of the meshes are made, unless they are made already."""
        if self._meshes is not None or not self._is_bound.any():
            return
        rows, n = {}, int(self.header[layout.N_LINK_PARTS])
        counts = np.bincount(setting.surroundings.body_of, minlength=1)
        for k, body in enumerate(setting.surroundings.body_of.tolist()):
            if counts[body] == 1:
                rows[body] = n + k
        workspace = (address_of(self._buffers[layout.DOUBLES_AT]), address_of(self._buffers[layout.INTEGERS_AT]))
        self._meshes = MeshQuestions(setting, rows, workspace)
        self._meshes.carry(setting)
        self.header[layout.MESH_QUESTIONS_AT] = address_of(self._meshes.words)

    @functools.cached_property
    def sample(self) -> tuple[np.ndarray, np.ndarray]:
        """Configurations (LANES, dof), and space for the samples that `sample_motions` leaves to others."""
        return np.zeros((LANES, max(self.robot.dof, 1))), np.empty((len(self._open), OPEN_SAMPLE))

    @property
    def open_pairs(self) -> np.ndarray:
        return self._open[: self.header[layout.N_OPEN]]


def _boxes_around(around: Surroundings) -> np.ndarray:
    """(parts, 6) boxes of the parts in the world, those of the tree."""
    return np.zeros((0, 6)) if around.tree is None else around.tree.boxes.copy()


class MotionWorkspace:
    """What `certify_motions` works on besides: paths of joints, intervals, pairs.

    open_intervals, mesh_pairs : (k, OPEN_INTERVAL) what the last call left open, and to others.
    """

    def __init__(self, robot: Robot, setting: Setting):
        number, n_bodies = {joint.name: k for k, joint in enumerate(robot.sorted_joints)}, len(setting.tables.bodies)
        names = paths_to_root(robot, [*range(len(robot.links))])
        paths = [np.array([number[name] for name in path], dtype=np.int64) for path in names]
        self._lengths_of_links = np.array([len(path) for path in paths], dtype=np.int64)
        stride = max(int(self._lengths_of_links.max(initial=0)), 1)
        self._paths_of_links = np.zeros((len(paths), stride), dtype=np.int64)
        for k, path in enumerate(paths):
            self._paths_of_links[k, : len(path)] = path
        moves = np.zeros((len(robot.sorted_joints), len(paths)), dtype=bool)
        for link, path in enumerate(paths):
            moves[path, link] = True
        beyond = (moves[:, :, None] & ~moves[:, None, :]).sum(axis=0)
        #: (links · links, 2) how many joints of each one's path are not of the other's.
        self._joints_between = np.stack([beyond, beyond.T], axis=2).reshape(-1, 2)
        links = setting.tables.bodies[:, layout.LINK]  # behind those of the robot's links, objects write theirs
        self._paths, self._lengths = self._paths_of_links[links], self._lengths_of_links[links]
        n_pairs = n_bodies * (n_bodies - 1) // 2 + n_bodies * setting.allowed.shape[1]
        self._filters: Filters | None = None
        n_items = min(_MAX_ITEMS, max(1024, motions.MAX_INTERVALS * n_pairs))
        # What links' places are made of, added up [m]. Where a body without end meets a body of the robot, roundings
        # are as large as the latter reaches.
        self._shifts = float(np.abs(setting.base[9:]).sum()) + float(np.abs(robot.joint_table.doubles[:, 9:12]).sum())
        self._reach = max(map(_reach_of, setting.tables.body_boxes[: setting.tables.n_bodies].tolist()), default=0.0)
        self._buffers = {
            motions.PATHS_AT: self._paths, motions.PATH_LENGTHS_AT: self._lengths,
            motions.CONFIGURATION_AT: np.zeros(max(robot.dof, 1)), motions.MOVED_AT: np.zeros((n_bodies, stride + 1)),
            motions.INTERVALS_AT: np.zeros((motions.MAX_INTERVALS + 1, motions.INTERVAL)),
            motions.ITEMS_AT: np.zeros((n_items + 1, motions.ITEM), dtype=np.int64),
            motions.CHANGES_AT: np.zeros(robot.dof + 1), motions.POINTS_AT: np.zeros(motions.MAX_DEGREE + 1),
            motions.BOXES_AT: np.zeros((motions.MAX_INTERVALS + 1, 2 * robot.dof + 1)),
        }
        self.header = np.zeros(motions.MOTION_HEADER, dtype=np.int64)
        for word, buffer in self._buffers.items():
            self.header[word] = address_of(buffer)
        self.header[motions.PATH_STRIDE], self.header[motions.ITEM_CAPACITY] = stride, n_items
        self._make_space(_OPEN_INTERVALS, motions.OPEN_INTERVAL)
        self.address = address_of(self.header)

    def carry(self, bodies: np.ndarray, setting: Setting) -> None:
        """Take over attached objects and tested pairs.   bodies : (n, BODY_INTS) of a `CheckWorkspace`. O(pairs)."""
        if setting.filters is self._filters:
            return
        self._filters = setting.filters
        for number, rows in enumerate(setting.objects, setting.tables.n_bodies):
            link = rows.body.link
            self._paths[number], self._lengths[number] = self._paths_of_links[link], self._lengths_of_links[link]
        links = bodies[:, layout.LINK].take(setting.self_pairs)
        self._between = self._joints_between.take(links[:, 0] * len(self._paths_of_links) + links[:, 1], axis=0)
        self.header[motions.BETWEEN_AT] = address_of(self._between)
        reach = max([self._reach, *(_reach_of(rows.tables.body_boxes[0].tolist()) for rows in setting.objects)])
        self.header[motions.ROUNDING :].view(np.float64)[:] = motions.ROUNDING_SHARE * (reach + self._shifts)

    def tables(self) -> dict[str, np.ndarray]:
        """Tables of motions as kernels read them, by name (`checker_file.py`), of the bodies of the last setting."""
        n = len(self._filters.allowed) if self._filters is not None else 0
        return {"paths": self._paths[:n], "path_lengths": self._lengths[:n], "between": self._between}

    def begin(self, resolution: float) -> None:
        """Count anew, of straight motions with this resolution [rad or m]."""
        words = [motions.N_CHECKED, motions.MOTION_KIND, motions.IS_EARLIEST, motions.CELL_LIMIT]
        self.header[words] = 0, motions.STRAIGHT, 0, 0
        self.header[motions.RESOLUTION : motions.ROUNDING].view(np.float64)[:] = resolution
        self._hits: np.ndarray | None = None
        if self.header[motions.OPEN_STRIDE] != motions.OPEN_INTERVAL:
            self._make_space(_OPEN_INTERVALS, motions.OPEN_INTERVAL)

    def ask_about_curves(self, degree: int) -> None:
        """Have the earliest collisions of Bézier curves searched; degree 1 is straight, too."""
        self.header[[motions.MOTION_KIND, motions.DEGREE, motions.IS_EARLIEST]] = motions.CURVED, degree, 1

    def ask_about_boxes(self, hits: np.ndarray, cell_limit: int) -> None:
        """Have boxes of configurations asked in so many cells each.   hits : (n, dof) of configurations to write."""
        self._hits = hits
        words = [motions.MOTION_KIND, motions.HITS_AT, motions.CELL_LIMIT]
        self.header[words] = motions.BOX_OF_CONFIGURATIONS, address_of(hits), cell_limit
        self._make_space(_OPEN_INTERVALS, motions.OPEN_INTERVAL + 2 * hits.shape[1])

    @property
    def is_earliest(self) -> bool:
        """Whether an earlier collision is searched after a hit."""
        return bool(self.header[motions.IS_EARLIEST])

    @property
    def cell_limit(self) -> int:
        """The most cells of a box that are asked; 0 where motions are not boxes."""
        return int(self.header[motions.CELL_LIMIT])

    def note_hit(self, times: np.ndarray, number: int, time: float, q: np.ndarray) -> None:
        """Write a collision found outside of the kernel, unless an earlier one is known and wanted."""
        times[number] = np.fmin(times[number], time) if self.is_earliest else time
        if self._hits is not None:
            self._hits[number] = q

    def _make_space(self, n: int, stride: int) -> None:
        """For so many open intervals and pairs of meshes, rows of so many doubles."""
        self.header[motions.OPEN_STRIDE] = stride
        self._open, self._meshes = np.empty((n, stride)), np.empty((n, stride))
        self.header[motions.OPEN_INTERVALS_AT], self.header[motions.MESH_PAIRS_AT] = map(
            address_of, (self._open, self._meshes)
        )
        self.header[motions.OPEN_INTERVAL_CAPACITY] = self.header[motions.MESH_PAIR_CAPACITY] = n

    def grow(self) -> None:
        """Make space for twice as many."""
        self._make_space(2 * len(self._open), self._open.shape[1])

    @property
    def open_intervals(self) -> np.ndarray:
        return self._open[: self.header[motions.N_OPEN_INTERVALS]]

    @property
    def mesh_pairs(self) -> np.ndarray:
        return self._meshes[: self.header[motions.N_MESH_PAIRS]]

    @property
    def n_checked(self) -> int:
        """Configurations asked so far."""
        return int(self.header[motions.N_CHECKED])


def _reach_of(box: list[float]) -> float:
    """How far a body reaches in its link [m]; 0 without an end."""
    return sum(map(abs, box)) if max(box) < UNBOUNDED_HALF else 0.0


def _without_spares(setting: Setting) -> Setting:
    """The setting for a workspace to hold: a list of spare workspaces with this workspace would close a circle, and
    shapes would outlive their checker until a search for garbage."""
    return setting._replace(spare=[])
