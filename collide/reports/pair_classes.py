"""The pairs of one class: rows of a World's answer in the order people read them, each made readable when looked at."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from collide.reports import proofs
from collide.reports.classes import proven_distances

#: Rows made readable at a time where all of them are wanted.
_CHUNK = 4096


@dataclass(frozen=True)
class Pair:
    """A pair of bodies; lengths in metres, vectors in the world frame.

    ``distance`` is signed, ``depth`` is max(0, −distance) of hits (``None`` of misses). ``normal`` points
    from a to b. ``approximated`` lists bodies of the pair read as another shape than named in the scene.
    """

    a: str
    b: str
    distance: float | None
    depth: float | None
    lower: float | None
    upper: float | None
    normal: list[float]
    point_a: list[float]
    point_b: list[float]
    part_a: int
    part_b: int
    how: str
    certified: bool
    approximated: list[str]

    @property
    def decided(self) -> bool:
        """Whether the sign is proven."""
        return self.how != proofs.UNDECIDED_NAME


#: Names of the fields, in their order.
FIELDS = tuple(field.name for field in fields(Pair))


class Fold(NamedTuple):
    """Pairs with a common body, told in a line: the first of them, the common body, and the number of pairs."""

    pair: Pair
    body: str
    size: int


class Pairs(Sequence):
    """A sequence of `Pair`; a million pairs stay arrays, each made a `Pair` on access.

    rows : of `collide.results.PAIR_DTYPE`.   order : (n,) indices of the rows in order.
    names : name of each body, by id.   approximated : names of bodies read as another shape than named in the scene.
    """

    def __init__(self, rows: np.ndarray, order: np.ndarray, names: Mapping[int, str], approximated: frozenset[str]):
        self._rows, self._order, self._names, self._approximated = rows, order, names, approximated

    @classmethod
    def of(cls, result, indices: np.ndarray, names: Mapping[int, str], approximated: frozenset[str]) -> Pairs:
        """The chosen rows of a `WorldResult`: those proven deepest or nearest first, then by distance, then by name."""
        rows = result.rows
        rank = _ranks(names)
        a, b = rank[rows["a"][indices]], rank[rows["b"][indices]]
        order = indices[np.lexsort((b, a, rows["distance"][indices], proven_distances(rows[indices])))]
        return cls(rows, order, names, approximated)

    def by_name(self) -> Pairs:
        """The same pairs in the order of their names."""
        rank = _ranks(self._names)
        a, b = (rank[self._rows[side][self._order]] for side in ("a", "b"))
        return Pairs(self._rows, self._order[np.lexsort((b, a))], self._names, self._approximated)

    def among(self, bodies: Container[str]) -> Pairs:
        """The pairs both of whose bodies are among these names, in their order."""
        is_among = np.zeros(max(self._names, default=-1) + 1, dtype=bool)
        is_among[[identity for identity, name in self._names.items() if name in bodies]] = True
        both = is_among[self._rows["a"][self._order]] & is_among[self._rows["b"][self._order]]
        return Pairs(self._rows, self._order[both], self._names, self._approximated)

    def __len__(self) -> int:
        return len(self._order)

    def __getitem__(self, k):
        if isinstance(k, slice):
            return self._made(self._order[k])
        return self._made(self._order[range(len(self))[k]][None])[0]

    def __iter__(self) -> Iterator[Pair]:
        for start in range(0, len(self._order), _CHUNK):
            yield from self._made(self._order[start : start + _CHUNK])

    def dicts(self) -> Iterator[dict]:
        """Each pair as plain data for JSON, one after the other."""
        for start in range(0, len(self._order), _CHUNK):
            yield from (dict(zip(FIELDS, values)) for values in self._values(self._order[start : start + _CHUNK]))

    def _made(self, indices: np.ndarray) -> list[Pair]:
        return [Pair(*values) for values in self._values(indices)]

    def _values(self, indices: np.ndarray) -> Iterator[tuple]:
        """The fields of `Pair`, row by row."""
        rows = self._rows[indices]
        distance, lower, upper = (_finite(rows[name]) for name in ("distance", "lower", "upper"))
        depth = [
            max(0.0, -d) if hit and d is not None else None for hit, d in zip(rows["hit"].tolist(), distance)
        ]
        a, b = ([self._names[k] for k in rows[side].tolist()] for side in ("a", "b"))
        approximated = [[name for name in pair if name in self._approximated] for pair in zip(a, b)]
        return zip(
            a, b, distance, depth, lower, upper, *(_plain(rows[name]) for name in ("normal", "point_a", "point_b")),
            rows["part_a"].tolist(), rows["part_b"].tolist(), map(proofs.name_of, rows["how"].tolist()),
            rows["certified"].tolist(), approximated,
        )

    # --- many at once ---------------------------------------------------------------------------

    def largest(self) -> float:
        """The largest gap or depth that the brackets leave room for [m]; 0 of no pairs."""
        lower, upper = (self._rows[end][self._order] for end in ("lower", "upper"))
        return float(np.maximum(-lower, upper).max(initial=0.0))

    def busiest(self) -> list[tuple[str, int]]:
        """(body, how many of these pairs it is in), most first, then by name."""
        ids, counts = np.unique(np.concatenate([self._rows[s][self._order] for s in ("a", "b")]), return_counts=True)
        pairs_of_body = [(self._names[i], n) for i, n in zip(ids.tolist(), counts.tolist())]
        return sorted(pairs_of_body, key=lambda item: (-item[1], item[0]))

    def folded(self, max_pairs: int, limit: int) -> tuple[list[Fold], int]:
        """The first ``limit`` lines of a listing of these pairs, and the number of pairs left untold.

        A body in more than ``max_pairs`` untold pairs has all of them told in a line, at the place of the first; of two
        such bodies in a pair the body with more untold pairs.
        """
        a, b = (self._rows[side][self._order] for side in ("a", "b"))
        remaining = np.ones(len(a), dtype=bool)
        folds: list[Fold] = []
        while len(folds) < limit and remaining.any():
            first = int(np.argmax(remaining))
            shared = [remaining & ((a == body) | (b == body)) for body in (a[first], b[first])]
            k = int(shared[1].sum() > shared[0].sum())
            count = int(shared[k].sum())
            pair = self[first]
            if count > max_pairs:
                remaining &= ~shared[k]
            else:
                remaining[first], count = False, 1
            folds.append(Fold(pair, (pair.a, pair.b)[k], count))
        return folds, int(remaining.sum())


def _ranks(names: Mapping[int, str]) -> np.ndarray:
    """Id of a body -> where its name stands among all names."""
    ranks = np.zeros(max(names, default=-1) + 1, dtype=np.int64)
    for rank, identity in enumerate(sorted(names, key=names.__getitem__)):
        ranks[identity] = rank
    return ranks


def _plain(column: np.ndarray) -> list:
    """Python's own numbers; −0.0 is 0.0."""
    return (column + 0.0).tolist()


def _finite(column: np.ndarray) -> list[float | None]:
    """The same, None where a number is infinite: an unbounded depth or bracket."""
    return [number if math.isfinite(number) else None for number in _plain(column)]
