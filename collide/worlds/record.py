"""What a World's statistics are made of, and what they are, worked out when somebody asks."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from collide.broadphase.filters import CULLED, count_skipped
from collide.results import HOW, UNDECIDED
from collide.worlds.bodies import Roster
from collide.worlds.packed_world import PackedWorld, PairFilters


class QueryRecord(NamedTuple):
    """A query of a whole World.

    packed : asked for its memory.   n_candidates : ``None`` where a hit came before all were known.
    rows : what was answered, fields hit, how and iterations at least.
    work : {what: number} of what was brought up to date for the query.
    """

    packed: PackedWorld
    roster: Roster
    filters: PairFilters
    n_candidates: int | None
    rows: np.ndarray
    convex_pairs: int
    body_pairs: int
    mesh_pairs: int
    work: dict
    seconds: dict

    def stats(self) -> dict:
        """As `World.stats` says."""
        roster = self.roster
        alive = roster.alive
        n = int(alive.sum())
        place = np.cumsum(alive) - 1
        allowed = self.filters.allowed
        is_there = alive[allowed].all(axis=1)
        reasons = [self.filters.reasons[k] for k in np.flatnonzero(is_there).tolist()]
        skipped = count_skipped(
            roster.static[alive], roster.group[alive], roster.mask[alive], roster.sleeping[alive],
            place[allowed[is_there]], reasons,
        )
        pairs = n * (n - 1) // 2
        if self.n_candidates is not None:
            skipped[CULLED] = pairs - sum(skipped.values()) - self.n_candidates
        return {
            "bodies": n, "static": int(roster.static[alive].sum()), "sleeping": int(roster.sleeping[alive].sum()),
            "pairs": pairs, "skipped": skipped,
            "narrowphase": self.body_pairs, "convex_pairs": self.convex_pairs, "mesh_pairs": self.mesh_pairs,
            "hits": int(self.rows["hit"].sum()), "undecided": int((self.rows["how"] == UNDECIDED).sum()),
            "how": dict(Counter(HOW[how] for how in self.rows["how"])),
            "gjk_iterations": int((self.rows["iterations"] & 0xFFFF).sum()),
            "epa_iterations": int((self.rows["iterations"] >> 16).sum()), "updates": self.work,
            "bytes_per_body": round(self.packed.nbytes / n) if n else 0, "seconds": self.seconds,
        }
