"""The bodies of a World and what filters say of them, packed for queries when one needs them."""

from __future__ import annotations

import copy
from collections.abc import Iterable

import numpy as np

from collide import argument_checks as checks
from collide.errors import InvalidArgument
from collide.log import log_duration
from collide.packed_world import PackedWorld
from collide.shapes.shape import Shape
from collide.world_bodies import BodiesAsTheyStood, Body, WorldBodies


class WorldScene:
    """Bodies that may touch, and the pairs of them that are never tested. `collide.World` adds the questions."""

    def __init__(self) -> None:
        self._bodies = WorldBodies()
        self._allowed: dict[tuple[int, int], str] = {}
        self._packed: PackedWorld | None = None

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along: bodies, names and what is allowed. The rest is made again."""
        return {"_bodies": copy.copy(self._bodies), "_allowed": dict(self._allowed), "_packed": None}

    def add(
        self, shape: Shape, X_WB=None, *, name: str | None = None, static: bool = False, group: int = 1,
        mask: int = 0xFFFF,
    ) -> int:  # fmt: skip
        """Add a body.

        Parameters
        ----------
        shape : any shape.
        X_WB : (4, 4) pose of the body in the world W [m], or what `collide.transforms.as_poses` takes for one; the
            identity if left out. It is copied.
        name : not empty, unique in this World; "body 7" and so on if left out.
        static : never tested against other static bodies.
        group, mask : bit sets of up to 32 bits: the groups it is in, and those it is tested against.

        Returns
        -------
        The body's id, an integer that is never used again. Ids ascend. About 3 µs.

        Raises
        ------
        InvalidArgument, InvalidPose : naming the argument and the value; nothing is added.
        """
        identity = self._bodies.add(shape, X_WB, name, static, group, mask)
        self._packed = None
        return identity

    def remove(self, body: int | str) -> None:
        """Take a body out, and what was allowed for it.

        Parameters
        ----------
        body : its id or name.

        Raises
        ------
        UnknownBody
        """
        identity = self._bodies.id_of(body)
        self._bodies.remove(identity)
        if self._allowed:
            self._allowed = {pair: reason for pair, reason in self._allowed.items() if identity not in pair}
        self._packed = None

    def set_pose(self, body: int | str, X_WB) -> None:
        """Move a body. About 2 µs.

        Parameters
        ----------
        body : its id or name.
        X_WB : (4, 4) its new pose in the world W [m]; it is copied.

        Raises
        ------
        UnknownBody, InvalidPose
        """
        self._bodies.move(self._bodies.id_of(body), X_WB)

    def set_poses(self, bodies: Iterable[int | str], X_WBs) -> None:
        """Move k bodies. About 0.1 µs a body, by ids.

        Parameters
        ----------
        bodies : (k,) ids, best as integers or an integer array, or names. Of a body named twice the last pose counts.
        X_WBs : (k, 4, 4) their new poses in the world W [m], in this order; they are copied.

        Raises
        ------
        UnknownBody, InvalidPose : then no body has moved.
        """
        self._bodies.move_many(bodies, X_WBs)

    def allow(self, a, b=None, *, reason: str = "allowed") -> None:
        """Never test a pair: ``allow("link3", "link4")``; or many, ``allow(matrix)``.

        Parameters
        ----------
        a, b : ids or names of two bodies; or a alone, a symmetric boolean matrix (n, n) over the n bodies in the order
            of `ids`, True for pairs that are not tested.
        reason : a few words; `stats` counts skipped pairs under it. A pair keeps its first.

        Raises
        ------
        UnknownBody; InvalidArgument : the same body twice, or a matrix of another form.
        """
        if b is None:
            matrix = checks.plain_array("World.allow: matrix", a, "(bodies, bodies)", InvalidArgument)
            self._allow_matrix(matrix, reason)
        else:
            i, j = self._bodies.id_of(a), self._bodies.id_of(b)
            if i == j:
                name = self._bodies.name_of(i)
                raise InvalidArgument(f'World.allow: "{name}" twice; a body is never tested against itself')
            self._allowed.setdefault((min(i, j), max(i, j)), str(reason))
        self._packed = None

    def _allow_matrix(self, matrix: np.ndarray, reason: str) -> None:
        n = len(self)
        if matrix.shape != (n, n) or matrix.dtype != bool or (matrix != matrix.T).any():
            raise InvalidArgument(
                f"World.allow: a matrix must be symmetric, boolean and ({n}, {n}) for the {n} bodies, "
                f"got {matrix.dtype} {matrix.shape}"
            )
        ids = self.ids
        for i, j in np.argwhere(np.triu(matrix, 1)).tolist():
            self._allowed.setdefault((ids[i], ids[j]), str(reason))

    def __len__(self) -> int:
        return len(self._bodies)

    @property
    def ids(self) -> list[int]:
        """Ids of all bodies, ascending."""
        return self._bodies.ids

    @property
    def names(self) -> dict[int, str]:
        """Name of each body, by id."""
        return self._bodies.names

    def body(self, body: int | str) -> Body:
        """The body of this id or name, as it stands now.

        Parameters
        ----------
        body : its id or name.

        Returns
        -------
        Body : ``id``, ``name``, ``shape``, ``X_WB``, ``static``, ``group`` and ``mask``; later moves do not reach it.

        Raises
        ------
        UnknownBody
        """
        return self._bodies.body(self._bodies.id_of(body))

    @property
    def allowed(self) -> dict[tuple[int, int], str]:
        """Pairs never tested: {(id, id): reason}, the smaller id first."""
        return dict(self._allowed)

    # --- as queries see them --------------------------------------------------------------------

    def _pack(self) -> PackedWorld:
        moved = self._bodies.take_moved()
        if self._packed is None:
            with log_duration("tables and box-tree of a World of %d bodies made", len(self)):
                roster = self._bodies.roster()
                position = {identity: k for k, identity in enumerate(roster.ids.tolist())} if self._allowed else {}
                allowed = {(position[i], position[j]): reason for (i, j), reason in self._allowed.items()}
                self._packed = PackedWorld(roster, self._bodies.poses(), allowed)
        elif len(moved):
            self._packed.move(moved, self._bodies.poses()[moved])
        return self._packed

    def _to_ids(self, rows: np.ndarray) -> BodiesAsTheyStood:
        """The bodies at the positions that rows name; in the rows, in place, their ids."""
        packed = self._pack()
        bodies = packed.bodies_named(rows["a"], rows["b"])
        rows["a"], rows["b"] = packed.roster.ids[rows["a"]], packed.roster.ids[rows["b"]]
        return bodies
