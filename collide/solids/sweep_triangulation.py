"""Triangles between the segments of a plane straight-line graph, by a sweep.

S. Hertel, K. Mehlhorn, "Fast triangulation of simple polygons" (1983), for graphs with loose ends: between two
neighbouring segments of the sweep line stands a chain of points bulging forwards, the border of the finished part. A
point cuts off all triangles of the chain in its sight. O(k log k) decisions for k points.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cmp_to_key
from itertools import pairwise

Side = Callable[[int, int, int], int]
Triangle = tuple[int, int, int]


def triangulate(n: int, segments: list[tuple[int, int]], side: Side) -> list[Triangle]:
    """Triangles (counter-clockwise) of all that the outermost segments enclose.

    n : points, numbered in the order of the sweep.   segments : (i, j), i < j, each once; they meet at their ends only,
    and no point lies within one.   side(i, j, k) : orientation of three points, 1, 0 or −1.
    The outer border has to be convex and among the segments. Between the same segments triangles are always the same.
    """
    starts: list[list[int]] = [[] for _ in range(n)]
    for i, j in segments:
        starts[i].append(j)
    sweep = _Sweep(side)
    for v in range(n):
        onward = sorted(starts[v], key=cmp_to_key(lambda p, q, v=v: -side(v, p, q)))  # type: ignore[misc]
        sweep.visit(v, onward)
    return sweep.triangles


class _Sweep:
    """lower_ends, upper_ends : the segments crossed by the sweep line, from below, by their ends.   chains : the chain
    above each segment but the last, from the segment below to the segment above.
    """

    def __init__(self, side: Side):
        self.side = side
        self.starts: list[int] = []
        self.ends: list[int] = []
        self.chains: list[list[int]] = []
        self.triangles: list[Triangle] = []

    def visit(self, v: int, onward: list[int]) -> None:
        starts, ends, chains = self.starts, self.ends, self.chains
        first = self._first_not_below(v)
        last = first
        while last < len(ends) and ends[last] == v:
            last += 1
        within = 0 < first and last < len(starts)
        if first == last:
            below, above = self._split(v, chains[first - 1]) if within else ([v], [v])
        else:
            for k in range(first, last - 1):
                self._close(v, chains[k])
            below = self._from_below(v, chains[first - 1]) if first > 0 else [v]
            above = self._from_above(v, chains[last - 1]) if last < len(starts) else [v]
        low, high = max(first - 1, 0), min(last, len(chains))
        if onward:
            between = [[v] for _ in onward[1:]]
            chains[low:high] = ([below] if first > 0 else []) + between + ([above] if last < len(starts) else [])
        elif within:
            chains[low:high] = [below + above[1:]]
        else:
            chains[low:high] = []
        starts[first:last] = [v] * len(onward)
        ends[first:last] = onward

    def _first_not_below(self, v: int) -> int:
        """The first segment, from below, that does not pass below v."""
        low, high = 0, len(self.starts)
        while low < high:
            middle = (low + high) // 2
            if self.ends[middle] != v and self.side(self.starts[middle], self.ends[middle], v) > 0:
                low = middle + 1
            else:
                high = middle
        return low

    def _close(self, v: int, chain: list[int]) -> None:
        self.triangles += [(p, v, q) for p, q in pairwise(chain)]

    def _from_below(self, v: int, chain: list[int]) -> list[int]:
        """The chain under a segment that ends at v, cut off from its upper end."""
        while len(chain) > 1 and self.side(chain[-2], v, chain[-1]) > 0:
            self.triangles.append((chain[-2], v, chain[-1]))
            chain.pop()
        return [*chain, v]

    def _from_above(self, v: int, chain: list[int]) -> list[int]:
        """The chain above a segment that ends at v, cut off from its lower end."""
        k = 0
        while k + 1 < len(chain) and self.side(chain[k], v, chain[k + 1]) > 0:
            self.triangles.append((chain[k], v, chain[k + 1]))
            k += 1
        return [v, *chain[k:]]

    def _split(self, v: int, chain: list[int]) -> tuple[list[int], list[int]]:
        """The chains below and above a point at which no segment ends: the point sees the last point of the chain."""
        k = chain.index(max(chain))
        return self._from_below(v, chain[: k + 1]), self._from_above(v, chain[k:])
