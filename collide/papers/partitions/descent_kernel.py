"""Points sent down a finished partition in doubles, as long as doubles tell the sides of cuts."""

from __future__ import annotations

from collide.kernels import entry, view_f64, view_i64

#: Words of a cut: a plane a x + b y + c z = d, the error of its heights by the largest coordinate, what stands below
#: and above (a cut, or ~leaf), and the axis, or FACET. 64 bytes, a line of the cache.
WORDS = 8
OFFSET, ERROR, BELOW, ABOVE, AXIS = 3, 4, 5, 6, 7
FACET = 3
#: Above all that underflow may take away from products of coordinates within 1e50.
_UNDERFLOW = 1e-200


@entry("void(int64, int64, int64, int64, int64, float64, int64)")
def descend(words_at, n_cuts, root, points_at, n, largest, leaf_at):
    """The leaf of each of n points, −1 for points in or near the plane of a cut.

    root : a cut, or ~leaf.   largest : no coordinate of the mesh is above.

    A normal n of doubles is off by 5 u p, p its permanent, for u = 2^−53 (`planes.py`); n · x − d by 4 u |n|
    (|x| + |a|) more, a the corner of the facet in d, and |n| ≤ (1 + 5 u) p. Together less than 20 u Σp times the
    largest coordinate; `ERROR` is 32 u Σp. A coordinate is compared with an axis-parallel plane exactly.
    """
    numbers = view_f64(words_at, WORDS * n_cuts)
    links = view_i64(words_at, WORDS * n_cuts)
    points = view_f64(points_at, 3 * n)
    leaf = view_i64(leaf_at, n)
    for i in range(n):
        x, y, z = points[3 * i], points[3 * i + 1], points[3 * i + 2]
        reach = max(max(abs(x), abs(y)), max(abs(z), largest))
        at = root
        while at >= 0:
            k = WORDS * at
            axis = links[k + AXIS]
            if axis == FACET:
                height = numbers[k] * x + numbers[k + 1] * y + numbers[k + 2] * z - numbers[k + OFFSET]
                bound = numbers[k + ERROR] * reach + _UNDERFLOW
            else:
                height = points[3 * i + axis] - numbers[k + OFFSET]
                bound = 0.0
            if height > bound:
                at = links[k + ABOVE]
            elif height < -bound:
                at = links[k + BELOW]
            else:
                break
        leaf[i] = ~at if at < 0 else -1
