"""Worlds of libcollide through ctypes, for tests: the changes and questions of a Python World, by the same names."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from ctypes import c_int, c_size_t, c_uint32, c_void_p

import c_library as c
import numpy as np

from collide.casts.ray_hits import WORLD_HIT_DTYPE
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.results import PAIR_DTYPE

Geometry = c.CShape | c.CMesh | c.CField


def _geometry(shape: Geometry) -> tuple[int | None, int | None, int | None]:
    """Handles of a shape, a mesh, a field: of what a body is, and None of the others."""
    return tuple(shape.handle if isinstance(shape, kind) else None for kind in (c.CShape, c.CMesh, c.CField))


class CBody(ctypes.Structure):
    """`collide_body`."""

    _fields_ = [
        ("size", c_size_t), ("shape", c_void_p), ("mesh", c_void_p), ("field", c_void_p), ("X_WB", c_void_p),
        ("is_static", c_int), ("group", c_uint32), ("mask", c_uint32),
    ]


class CWorld:
    """A world, and the workspace it is asked with unless another one is handed in. Changes return statuses; questions
    return (status, answer)."""

    def __init__(self):
        self._library, out = c.library(), c_void_p()
        assert self._library.collide_world_create(ctypes.byref(out)) == c.OK
        self.handle, self.asker = out.value, c.Asker()

    def __del__(self):
        self._library.collide_world_free(self.handle)

    def __len__(self) -> int:
        return self._library.collide_world_size(self.handle)

    @property
    def message(self) -> str:
        """Of the last change."""
        return self._library.collide_world_message(self.handle).decode()

    @property
    def question_message(self) -> str:
        return self._library.collide_workspace_message(self.asker.handle).decode()

    # --- changes --------------------------------------------------------------------------------

    def add(self, shape: Geometry, X_WB, static: bool = False, group: int = 1, mask: int = 0xFFFF) -> tuple[int, int]:
        """(status, id)."""
        status, ids = self.add_many([(shape, X_WB, static, group, mask)])
        return status, ids[0]

    def add_many(self, bodies: list[tuple]) -> tuple[int, list[int]]:
        """(status, ids) of bodies (shape, X_WB, static, group, mask)."""
        held = [np.ascontiguousarray(X, dtype=np.float64) for _, X, *_ in bodies]
        made = (CBody * len(bodies))(*(
            CBody(ctypes.sizeof(CBody), *_geometry(shape), X.ctypes.data, static, group, mask)
            for (shape, _, static, group, mask), X in zip(bodies, held)
        ))
        ids = np.full(len(bodies), -7, dtype=np.int32)
        return self._library.collide_world_add(self.handle, made, len(bodies), ids.ctypes.data), ids.tolist()

    def remove(self, identity: int) -> int:
        return self._library.collide_world_remove(self.handle, identity)

    def move(self, ids, X_WBs) -> int:
        ids, X_WBs = np.ascontiguousarray(ids, dtype=np.int32), np.ascontiguousarray(X_WBs, dtype=np.float64)
        return self._library.collide_world_move(self.handle, ids.ctypes.data, len(ids), X_WBs.ctypes.data)

    def replace(self, identity: int, shape: Geometry) -> int:
        kind = {c.CShape: "", c.CMesh: "_mesh", c.CField: "_field"}[type(shape)]
        return getattr(self._library, f"collide_world_replace{kind}")(self.handle, identity, shape.handle)

    def sleep(self, ids, asleep: bool) -> int:
        ids = np.ascontiguousarray(ids, dtype=np.int32)
        return self._library.collide_world_sleep(self.handle, ids.ctypes.data, len(ids), asleep)

    def allow(self, pairs) -> int:
        pairs = np.ascontiguousarray(pairs, dtype=np.int32).reshape(-1, 2)
        return self._library.collide_world_allow(self.handle, pairs.ctypes.data, len(pairs))

    def set_margins(self, ids, margins) -> int:
        ids, margins = np.ascontiguousarray(ids, dtype=np.int32), np.ascontiguousarray(margins, dtype=np.float64)
        return self._library.collide_world_set_margins(self.handle, ids.ctypes.data, len(ids), margins.ctypes.data)

    def set_pair_margins(self, pairs, margins) -> int:
        """margins : ``None`` takes them away."""
        pairs = np.ascontiguousarray(pairs, dtype=np.int32).reshape(-1, 2)
        margins = None if margins is None else np.ascontiguousarray(margins, dtype=np.float64)
        at = None if margins is None else margins.ctypes.data
        return self._library.collide_world_set_pair_margins(self.handle, pairs.ctypes.data, len(pairs), at)

    def pose(self, identity: int) -> tuple[int, np.ndarray]:
        X = np.zeros((4, 4))
        return self._library.collide_world_pose(self.handle, identity, X.ctypes.data), X

    # --- questions ------------------------------------------------------------------------------

    def collides(self, asker: c.Asker | None = None) -> tuple[int, bool]:
        hit = c_int(7)
        return self._library.collide_world_collides(self.handle, self._of(asker), hit), bool(hit.value)

    def within(self, margin: float, asker: c.Asker | None = None) -> tuple[int, bool]:
        hit = c_int(7)
        return self._library.collide_world_within(self.handle, self._of(asker), margin, hit), bool(hit.value)

    def collisions(self, asker: c.Asker | None = None, capacity: int | None = None):
        return self._rows(self._library.collide_world_collisions, PAIR_DTYPE, capacity, self._of(asker))

    def hits(self, asker: c.Asker | None = None, capacity: int | None = None):
        """(status, (k, 2) ids of pairs that hit)."""
        dtype = np.dtype((np.int32, 2))
        return self._rows(self._library.collide_world_hits, dtype, capacity, self._of(asker))

    def distances(self, limit: float = math.inf, asker: c.Asker | None = None, capacity: int | None = None):
        return self._rows(self._library.collide_world_distances, PAIR_DTYPE, capacity, self._of(asker), limit)

    def minimum(self, limit: float = math.inf, asker: c.Asker | None = None):
        row, count = np.zeros(1, dtype=PAIR_DTYPE), c_size_t(7)
        status = self._library.collide_world_minimum(self.handle, self._of(asker), limit, row.ctypes.data, count)
        return status, row[: count.value]

    def contacts(
        self, margin: float = 0.0, max_contacts: int = 8, asker: c.Asker | None = None, capacity: int | None = None
    ):
        ask = self._library.collide_world_contacts
        return self._rows(ask, CONTACT_DTYPE, capacity, self._of(asker), margin, max_contacts)

    def query(self, shape: c.CShape, X_WS, limit: float = 0.0, asker: c.Asker | None = None, capacity=None):
        X_WS = np.ascontiguousarray(X_WS, dtype=np.float64)
        ask = self._library.collide_world_query
        return self._rows(ask, PAIR_DTYPE, capacity, self._of(asker), shape.handle, X_WS.ctypes.data, limit)

    def boxes_near(self, low, high, margin: float = 0.0, asker: c.Asker | None = None, capacity=None):
        low, high = (np.ascontiguousarray(corner, dtype=np.float64) for corner in (low, high))
        ask = self._library.collide_world_boxes_near
        return self._rows(ask, np.int32, capacity, self._of(asker), low.ctypes.data, high.ctypes.data, margin)

    def raycast(self, origins, directions, limit: float = math.inf, group=None, mask=None, asker=None):
        """(status, rows, status of each)."""
        origins, directions = (np.ascontiguousarray(v, dtype=np.float64).reshape(-1, 3) for v in (origins, directions))
        rows, statuses = np.zeros(len(origins), dtype=WORLD_HIT_DTYPE), np.full(len(origins), -1, dtype=np.int32)
        status = self._library.collide_world_raycast(
            self.handle, self._of(asker), origins.ctypes.data, directions.ctypes.data, len(origins), limit,
            _bits(group), _bits(mask), rows.ctypes.data, statuses.ctypes.data,
        )
        return status, rows, statuses

    def cast(
        self, shape: c.CShape, X_WS, directions, limit: float = math.inf, flags: int = 0, group=None, mask=None,
        asker=None,
    ):
        """(status, rows, status of each)."""
        X_WS = np.ascontiguousarray(X_WS, dtype=np.float64).reshape(-1, 4, 4)
        directions = np.ascontiguousarray(directions, dtype=np.float64).reshape(-1, 3)
        n = max(len(X_WS), len(directions))
        rows, statuses = np.zeros(n, dtype=WORLD_HIT_DTYPE), np.full(n, -1, dtype=np.int32)
        status = self._library.collide_world_cast(
            self.handle, self._of(asker), shape.handle, c.Poses(X_WS.ctypes.data, len(X_WS)),
            c.Vectors(directions.ctypes.data, len(directions)), limit, flags, _bits(group), _bits(mask),
            rows.ctypes.data, statuses.ctypes.data,
        )
        return status, rows, statuses

    def nearest(self, points, limit: float = math.inf, group=None, mask=None, asker=None):
        points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        rows = np.zeros(len(points), dtype=WORLD_HIT_DTYPE)
        status = self._library.collide_world_nearest(
            self.handle, self._of(asker), points.ctypes.data, len(points), limit, _bits(group), _bits(mask),
            rows.ctypes.data,
        )
        return status, rows

    def _of(self, asker: c.Asker | None) -> int:
        return (asker or self.asker).handle

    def _rows(self, ask: Callable, dtype, capacity: int | None, *arguments) -> tuple[int, np.ndarray]:
        """Rows of a question; without a capacity with room for as many as there are."""
        count = c_size_t(7)
        if capacity is None:
            status = ask(self.handle, *arguments, None, 0, count)
            if status not in (c.OK, c.TOO_MANY):
                return status, np.zeros(0, dtype)
            capacity = count.value
        rows = np.full(max(capacity, 1), 7, dtype=dtype)
        status = ask(self.handle, *arguments, rows.ctypes.data, capacity, count)
        return status, rows[: min(count.value, capacity)]


def _bits(value: int | None):
    return None if value is None else ctypes.byref(c_uint32(value))
