"""The farthest of many points in a direction, by a scan over blocks of coordinates.

Support queries end here: small point sets are scanned as a whole, large ones through the short lists
of `support_tree`. Products and sums round one by one in the order x·gx + y·gy + z·gz, so the value of
a point does not depend on its place, on the processor, or on whether kernels are compiled.
"""

from __future__ import annotations

from collide.kernels import WITH_NUMBA, kernel


@kernel
def farthest_one_by_one(coordinates, start, stride, count, gx, gy, gz):
    """`farthest`, one point at a time: what plain Python runs, and what tests compare with."""
    best = coordinates[start] * gx + coordinates[start + stride] * gy + coordinates[start + 2 * stride] * gz
    index = 0
    for i in range(1, count):
        at = start + i
        value = coordinates[at] * gx + coordinates[at + stride] * gy + coordinates[at + 2 * stride] * gz
        if value > best:
            best = value
            index = i
    return index, best + 0.0  # −0 becomes 0


@kernel
def least_one_by_one(numbers, count):
    """`least`, one number at a time."""
    index = 0
    for i in range(1, count):
        if numbers[i] < numbers[index]:
            index = i
    return index


@kernel
def count_level_one_by_one(coordinates, stride, count, gx, gy, gz, limit):
    """`count_level`, one point at a time."""
    n_level = 0
    for i in range(count):
        if coordinates[i] * gx + coordinates[stride + i] * gy + coordinates[2 * stride + i] * gz <= limit:
            n_level += 1
    return n_level


if not WITH_NUMBA:
    farthest = farthest_listed = farthest_one_by_one
    least, count_level = least_one_by_one, count_level_one_by_one
else:
    from collide.kernels.vectors import farthest_of_blocks as farthest
    from collide.kernels.vectors import farthest_of_list as farthest_listed
    from collide.kernels.vectors import least_of_blocks as least
    from collide.kernels.vectors import level_in_blocks as count_level

#: ``farthest(coordinates, start, stride, count, gx, gy, gz) -> (index, value)``: the largest
#: x·gx + y·gy + z·gz among ``count`` points, 8 or more. Point i has its x at
#: ``start + i`` of the view, its y ``stride`` later, its z 2·``stride`` later. The lowest index wins
#: among equal values (−0 equals 0, and is given as 0), so copies that fill up a block never win over what they copy.
#: Values must not be NaN. O(count).
#: ``farthest_listed``: the same for lists of some 40 points whose lengths differ.
#: ``least(numbers, count) -> index``: of the least of the first ``count`` numbers, 8 or more.
#: ``count_level(coordinates, stride, count, gx, gy, gz, limit) -> n``: how many of the first ``count`` points, a
#: multiple of 8, have a product at most the limit.
__all__ = [
    "count_level", "count_level_one_by_one", "farthest", "farthest_listed", "farthest_one_by_one", "least",
    "least_one_by_one",
]
