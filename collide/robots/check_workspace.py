"""Buffers of a thread's kernels for checking a robot, and the headers with the addresses of these buffers."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, code_of
from collide.lowering.shape_table import NO_TERMS, POSE
from collide.narrowphase.facets.nearest_item_kernel import gap_of_part, state_of_part
from collide.narrowphase.pair_kernel import DOUBLES, INTEGERS, answer_pairs
from collide.results import PAIR_DTYPE
from collide.robots import check_scene as layout
from collide.robots import motion_bounds as motions
from collide.robots.check_tables import Setting
from collide.robots.field_walks import field_walks
from collide.robots.forward_kinematics import JointTable

#: Pairs left to others that a call has space for, at least.
_LEAST_OPEN = 4096
#: Pairs of parts that may stay open at once while a motion is halved, at most.
_MAX_ITEMS = 1 << 20
_OPEN_INTERVALS = 4096


class CheckWorkspace:
    """One thread's buffers.

    header, motion_header : of `check_scene.py` and `motion_bounds.py`.
    open_pairs : (k, OPEN_INTS) what the last call left to others.   open_intervals : (k, OPEN_INTERVAL).
    """

    def __init__(self, joints: JointTable, setting: Setting):
        self._setting = joints, setting  # kernels read what they hold
        tables, around = setting.tables, setting.surroundings
        self_pairs, allowed = setting.self_pairs, setting.allowed
        n_bodies, n_parts, n_around = len(tables.bodies), len(tables.poses), len(around.packed)
        nothing = np.zeros(1, dtype=np.int64)
        tree = around.tree
        unbounded = np.ascontiguousarray(tree.unbounded, dtype=np.int64) if tree is not None else nothing[:0]
        n_link_parts = n_parts - n_around
        # One configuration leaves each pair of parts to others at most once.
        capacity = max(_LEAST_OPEN, n_link_parts * (n_around + n_link_parts) + 1)
        self._open = np.empty((capacity, layout.OPEN_INTS), dtype=np.int64)
        self._buffers = buffers = {
            layout.POSES_AT: tables.poses.copy(), layout.LINKS_AT: np.zeros((joints.n_links, POSE)),
            layout.WORLD_BOXES_AT: np.zeros((n_bodies, layout.BOX)),
            layout.PLACED_AT: np.zeros(n_parts, dtype=np.int64),
            layout.CANDIDATES_AT: np.zeros(n_parts + 1, dtype=np.int64), layout.PAIR_AT: np.zeros(2, dtype=np.int64),
            layout.ROW_AT: np.zeros(1, dtype=PAIR_DTYPE), layout.DOUBLES_AT: np.zeros(DOUBLES),
            layout.INTEGERS_AT: np.zeros(INTEGERS, dtype=np.int64), layout.OPEN_AT: self._open,
            layout.JOINT_INTS_AT: joints.ints, layout.JOINT_DOUBLES_AT: joints.doubles, layout.BASE_AT: setting.base,
            layout.BODIES_AT: tables.bodies, layout.BODY_BOXES_AT: tables.body_boxes, layout.SELF_PAIRS_AT: self_pairs,
            layout.PARTS_AT: tables.parts, layout.PART_BOXES_AT: tables.part_boxes, layout.IS_BOUND_AT: tables.is_bound,
            layout.UNBOUNDED_AT: unbounded, layout.BODY_OF_AT: around.body_of, layout.ALLOWED_AT: allowed,
            layout.TERMS_AT: NO_TERMS, layout.SHAPE_OF_AT: tables.shape_of,
        }
        self._walks = field_walks(around, *map(address_of, (buffers[layout.DOUBLES_AT], buffers[layout.INTEGERS_AT])))
        buffers[layout.WALKS_AT] = self._walks.words
        numbers = {
            layout.N_JOINTS: len(joints.ints), layout.ROOT: joints.root, layout.N_LINKS: joints.n_links,
            layout.CORE: code_of(answer_pairs), layout.STATE_OF_PART: code_of(state_of_part),
            layout.GAP_OF_PART: code_of(gap_of_part), layout.N_BODIES: n_bodies, layout.N_SELF_PAIRS: len(self_pairs),
            layout.N_LINK_PARTS: n_parts - n_around, layout.PADDED: tables.padded, layout.N_PARTS: n_parts,
            layout.N_UNBOUNDED: len(unbounded), layout.N_AROUND: allowed.shape[1],
            layout.OPEN_CAPACITY: capacity,
        }
        if tree is not None:
            buffers |= {layout.NODES_AT: tree.nodes, layout.NODE_LINKS_AT: tree.links}
            numbers |= {layout.N_NODES: tree.n_nodes}
        self.header = np.zeros(layout.HEADER, dtype=np.int64)
        for word, number in numbers.items():
            self.header[word] = number
        for word, buffer in buffers.items():
            self.header[word] = address_of(buffer)
        self.header[layout.INTS_AT], self.header[layout.NUMBERS_AT] = tables.table.addresses
        self.header[layout.SLACK : layout.SLACK + 1].view(np.float64)[:] = tables.slack
        self.address = address_of(self.header)

    @property
    def open_pairs(self) -> np.ndarray:
        return self._open[: self.header[layout.N_OPEN]]


class MotionWorkspace:
    """What `certify_motions` works on besides: paths of joints, intervals, pairs.

    open_intervals, mesh_pairs : (k, OPEN_INTERVAL) what the last call left open, and to others.
    """

    def __init__(self, paths: list[np.ndarray], between: np.ndarray, dof: int, n_pairs: int, resolution: float,
                 rounding: float):
        lengths = np.array([len(path) for path in paths], dtype=np.int64)
        stride = max(int(lengths.max(initial=0)), 1)
        table = np.zeros((len(paths), stride), dtype=np.int64)
        for k, path in enumerate(paths):
            table[k, : len(path)] = path
        n_items = min(_MAX_ITEMS, max(1024, motions.MAX_INTERVALS * n_pairs))
        self._buffers = {
            motions.PATHS_AT: table, motions.PATH_LENGTHS_AT: lengths, motions.BETWEEN_AT: between,
            motions.CONFIGURATION_AT: np.zeros(max(dof, 1)), motions.MOVED_AT: np.zeros((len(paths), stride + 1)),
            motions.INTERVALS_AT: np.zeros((motions.MAX_INTERVALS + 1, motions.INTERVAL)),
            motions.ITEMS_AT: np.empty((n_items + 1, motions.ITEM), dtype=np.int64),
        }
        self.header = np.zeros(motions.MOTION_HEADER, dtype=np.int64)
        for word, buffer in self._buffers.items():
            self.header[word] = address_of(buffer)
        self.header[motions.PATH_STRIDE], self.header[motions.ITEM_CAPACITY] = stride, n_items
        self._make_space(_OPEN_INTERVALS)
        self.header[motions.RESOLUTION :].view(np.float64)[:] = resolution, rounding
        self.address = address_of(self.header)

    def _make_space(self, n: int) -> None:
        """For so many open intervals and pairs of meshes."""
        self._open, self._meshes = np.empty((n, motions.OPEN_INTERVAL)), np.empty((n, motions.OPEN_INTERVAL))
        self.header[motions.OPEN_INTERVALS_AT], self.header[motions.MESH_PAIRS_AT] = map(
            address_of, (self._open, self._meshes)
        )
        self.header[motions.OPEN_INTERVAL_CAPACITY] = self.header[motions.MESH_PAIR_CAPACITY] = n

    def grow(self) -> None:
        """Make space for twice as many."""
        self._make_space(2 * len(self._open))

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
