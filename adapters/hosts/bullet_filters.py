"""Which pairs of links Bullet never tests in a step, so far as it was told here: pybullet gives no filter back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from collide.adapters.hosts.bullet_bodies import Geom

#: Bullet's groups and masks of bodies that move, and of bases without mass, as 32 bits.
_ALL = 0xFFFF_FFFF
MOVING, FIXED = (1, _ALL), (2, _ALL ^ 2)
#: Flags of loadURDF: links of the body are tested against each other; which of them are not.
USE_SELF_COLLISION, EXCLUDE_PARENT, EXCLUDE_ALL_PARENTS, INCLUDE_PARENT = 8, 16, 32, 8192


class CollisionFilters:
    """Groups and masks of links, pairs switched on or off, and bodies whose links may meet each other."""

    def __init__(self) -> None:
        self._group_masks: dict[tuple[int, int], tuple[int, int]] = {}
        self._pairs: dict[frozenset[tuple[int, int]], bool] = {}
        self._self_flags: dict[int, int] = {}
        #: Whether A's group must be in B's mask and B's in A's; by default one of them is enough.
        self.needs_both = False

    def set_group_mask(self, body: int, link: int, group: int, mask: int) -> None:
        self._group_masks[body, link] = group & _ALL, mask & _ALL

    def set_pair(self, body_a: int, link_a: int, body_b: int, link_b: int, enable: bool) -> None:
        self._pairs[frozenset(((body_a, link_a), (body_b, link_b)))] = enable

    def set_self_collision(self, body: int, flags: int) -> None:
        """flags : those of loadURDF that the body was loaded with."""
        self._self_flags[body] = flags

    def forget(self, bodies: set[int]) -> None:
        """Bodies are gone; their numbers may come again. Pairs stay switched, as in Bullet."""
        self._group_masks = {place: bits for place, bits in self._group_masks.items() if place[0] not in bodies}
        self._self_flags = {body: flags for body, flags in self._self_flags.items() if body not in bodies}

    def clear_all(self) -> None:
        """The simulation was reset."""
        self.__init__()  # type: ignore[misc]

    def bits(self, geom: Geom) -> tuple[int, int]:
        """Group and mask of a link."""
        return self._group_masks.get((geom.body, geom.link), FIXED if geom.fixed else MOVING)

    @property
    def are_bullets_own(self) -> bool:
        """Whether a World's rule for groups and masks gives what Bullet's gives: nothing was set."""
        return not self._group_masks and not any(self._pairs.values())

    def tests(self, A: Geom, B: Geom) -> bool:
        """Whether two links are tested against each other; the rule of `never_tested` and `incompatible` for a pair."""
        is_on = self._pairs.get(frozenset(((A.body, A.link), (B.body, B.link))))
        if A.body == B.body and not _links_meet(A, B, self._self_flags.get(A.body, 0)):
            return False
        if is_on is not None:
            return is_on
        (group_a, mask_a), (group_b, mask_b) = self.bits(A), self.bits(B)
        forth, back = group_a & mask_b != 0, group_b & mask_a != 0
        return forth and back if self.needs_both else forth or back

    def never_tested(self, geoms: Sequence[Geom]) -> list[tuple[int, int, str]]:
        """(row, row, reason) of pairs that are left out, besides those that groups and masks exclude."""
        rows = {(geom.body, geom.link): row for row, geom in enumerate(geoms)}
        left_out = []
        of_body: dict[int, list[int]] = {}
        for row, geom in enumerate(geoms):
            of_body.setdefault(geom.body, []).append(row)
        for body, members in of_body.items():
            flags = self._self_flags.get(body, 0)
            for k, i in enumerate(members):
                for j in members[k + 1 :]:
                    if not _links_meet(geoms[i], geoms[j], flags):
                        left_out.append((i, j, "links of one body"))
        for pair, enable in self._pairs.items():
            places = [rows.get(place, -1) for place in pair]
            if not enable and len(places) == 2 and min(places) >= 0:
                left_out.append((min(places), max(places), "switched off by setCollisionFilterPair"))
        return left_out

    def incompatible(self, geoms: Sequence[Geom]) -> np.ndarray:
        """(k, 2) rows of pairs that groups and masks exclude, i < j, but for those that are switched on."""
        bits = np.array([self.bits(geom) for geom in geoms], dtype=np.int64).reshape(-1, 2)
        group, mask = bits.T
        forth, back = (group[:, None] & mask[None, :]) != 0, (mask[:, None] & group[None, :]) != 0
        pairs = np.argwhere(np.triu(~(forth & back if self.needs_both else forth | back), 1))
        is_on = [self._is_on(geoms[i], geoms[j]) for i, j in pairs.tolist()] if self._pairs else [False] * len(pairs)
        return pairs[~np.array(is_on, dtype=bool)]

    def _is_on(self, A: Geom, B: Geom) -> bool:
        return self._pairs.get(frozenset(((A.body, A.link), (B.body, B.link))), False)


def _links_meet(A: Geom, B: Geom, flags: int) -> bool:
    """Whether Bullet tests two links of one body that was loaded with these flags."""
    if not flags & USE_SELF_COLLISION:
        return False
    if flags & EXCLUDE_ALL_PARENTS:
        return A.link not in B.parents and B.link not in A.parents
    if flags & INCLUDE_PARENT:
        return True
    return A.link not in B.parents[:1] and B.link not in A.parents[:1]
