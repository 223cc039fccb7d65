"""One box against the eight of a node: the innermost step of every traversal of mesh trees.

The axes are the three of each frame (S. Gottschalk's other nine cost more than they cull) and, where distances are
computed, the line between the centres and the direction of the nearest points so far. Floats round here; whoever
fills the probe enlarges its half lengths by a bound of this rounding, so boxes that meet are never culled, and no bound
is above the distance. Sums go from left to right, so compiled and plain code give the same bits.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import WITH_NUMBA
from collide.mesh.bvh import WIDTH

#: Floats of a frame: the matrix from the node's frame to the probe's, row by row.
FRAME = 9
#: Floats of a probe: the box's centre in the node's frame (3) and its half lengths there (3), enlarged; then
#: the frame's shift less the box's centre (3) and its half lengths (3), enlarged, in the box's own frame. Where only
#: meeting is asked: a slab around the box's contents, its normal in the node's frame (3), its middle (1) and its half
#: width (1), enlarged; zeros for none.
PROBE = 17
#: A triangle as probe has three half-spaces more that hold it, one an edge: the outward direction in the node's frame
#: (3) and how far its origin is out (1), less rounding.
PRISM = PROBE + 12
#: For distances, from 12 on: the least lengths in the world of a gap of 1 along the axes of the node's frame (3), of
#: the probe's (3) and along any line in it (1); a direction in the node's frame (3) and its gap from the probe to the
#: node's middle (1).
NEAR_PROBE = 23


def boxes_meeting_one_by_one(boxes, at, frame, probe):
    """`boxes_meeting` in numpy's floats: what plain Python runs, and what tests compare with."""
    with np.errstate(all="ignore"):
        rows = boxes[at : at + 6 * WIDTH].reshape(6, WIDTH)
        apart = rows[3] < 0.0  # slots that are not used
        for axis in range(3):
            apart |= np.abs(rows[axis] - probe[axis]) > rows[3 + axis] + probe[3 + axis]
            gap, reach = _along(rows, frame, probe, axis)
            apart |= np.abs(gap) > reach
        gap = np.full(WIDTH, probe[15])
        reach = np.full(WIDTH, probe[16])
        for j in range(3):
            gap = gap + probe[12 + j] * rows[j]
            reach = reach + np.abs(probe[12 + j]) * rows[3 + j]
        apart |= np.abs(gap) > reach
    return int(np.packbits(~apart, bitorder="little")[0])


def boxes_meeting_prism_one_by_one(boxes, at, frame, probe):
    """`boxes_meeting_prism` in numpy's floats."""
    mask = boxes_meeting_one_by_one(boxes, at, frame, probe)
    with np.errstate(all="ignore"):
        rows = boxes[at : at + 6 * WIDTH].reshape(6, WIDTH)
        for edge in range(PROBE, PRISM, 4):
            mask &= ~int(np.packbits(_outside(rows, probe, edge), bitorder="little")[0])
    return mask


def boxes_within_one_by_one(boxes, at, frame, probe):
    """`boxes_within` in numpy's floats."""
    rows = boxes[at : at + 6 * WIDTH].reshape(6, WIDTH)
    with np.errstate(all="ignore"):
        beyond, square = rows[3] < 0.0, np.float32(0.0)
        for axis in range(3):
            beyond |= np.abs(rows[axis] - probe[axis]) > rows[3 + axis] + probe[3 + axis]
            gap, reach = _along(rows, frame, probe, axis)
            gap = np.abs(gap) - reach
            gap = np.where(gap > 0.0, gap, np.float32(0.0))
            square = square + gap * gap
        beyond |= square > probe[12]
        for plane in range(PROBE, PRISM, 4):
            beyond |= _outside(rows, probe, plane)
    return int(np.packbits(~beyond, bitorder="little")[0])


def points_within_one_by_one(points, at, frame, probe):
    """`points_within` in numpy's floats."""
    rows = np.zeros(6 * WIDTH, dtype=np.float32)
    rows[: 3 * WIDTH] = points[at : at + 3 * WIDTH]
    return boxes_within_one_by_one(rows, 0, frame, probe)


def boxes_near_place_one_by_one(boxes, at, x, y, z, limit):
    """`boxes_near_place` in numpy's floats."""
    with np.errstate(all="ignore"):
        rows = boxes[at : at + 6 * WIDTH].reshape(6, WIDTH)
        gaps = [np.abs(rows[axis] - place) - rows[3 + axis] for axis, place in enumerate(np.float32((x, y, z)))]
        x, y, z = (np.where(gap > 0.0, gap, np.float32(0.0)) for gap in gaps)
        return int(np.packbits(x * x + y * y + z * z <= np.float32(limit), bitorder="little")[0])


def patches_near_place_one_by_one(boxes, at, slabs, slab_at, x, y, z, limit, reach):
    """`patches_near_place` in numpy's floats."""
    mask = boxes_near_place_one_by_one(boxes, at, x, y, z, limit)
    with np.errstate(all="ignore"):
        rows = slabs[slab_at : slab_at + 5 * WIDTH].reshape(5, WIDTH)
        height = -rows[3]
        for axis, place in enumerate(np.float32((x, y, z))):
            height = height + rows[axis] * place
        near = np.abs(height) - rows[4] <= np.float32(reach)
    return mask & int(np.packbits(near, bitorder="little")[0])


def points_near_place_one_by_one(points, at, x, y, z, limit):
    """`points_near_place` in numpy's floats."""
    with np.errstate(all="ignore"):
        rows = points[at : at + 3 * WIDTH].reshape(3, WIDTH)
        x, y, z = (np.abs(rows[axis] - place) for axis, place in enumerate(np.float32((x, y, z))))
        return int(np.packbits(x * x + y * y + z * z <= np.float32(limit), bitorder="little")[0])


def boxes_nearest_one_by_one(boxes, at, slabs, slab_at, frame, probe, out):
    """`boxes_nearest` in numpy's floats."""
    with np.errstate(all="ignore"):
        rows = boxes[at : at + 6 * WIDTH].reshape(6, WIDTH)
        best = np.full(WIDTH, -np.inf, dtype=np.float32)
        lines, across, square = [], np.float32(0.0), np.float32(0.0)
        for axis in range(3):
            gap = np.abs(rows[axis] - probe[axis]) - (rows[3 + axis] + probe[3 + axis])
            best = np.where(gap * probe[12 + axis] > best, gap * probe[12 + axis], best)
        for axis in range(3):
            gap, reach = _along(rows, frame, probe, axis)
            lines.append(gap)
            scaled = (np.abs(gap) - reach) * probe[15 + axis]
            best = np.where(scaled > best, scaled, best)
            across = across + np.abs(gap) * probe[9 + axis]
            square = square + gap * gap
        for j in range(3):
            along = lines[0] * frame[j] + lines[1] * frame[3 + j] + lines[2] * frame[6 + j]
            across = across + np.abs(along) * rows[3 + j]
        gap = (square - across) / np.sqrt(square) * probe[18]
        best = np.where(gap > best, gap, best)
        plain = thin = np.full(WIDTH, probe[22])
        normals = slabs[slab_at : slab_at + 5 * WIDTH].reshape(5, WIDTH)
        share = probe[19] * normals[0] + probe[20] * normals[1] + probe[21] * normals[2]
        thin = thin + share * normals[3]
        thin = thin - np.abs(share) * normals[4]
        for j in range(3):
            plain = plain + probe[19 + j] * rows[j]
            plain = plain - np.abs(probe[19 + j]) * rows[3 + j]
            rest = probe[19 + j] - share * normals[j]
            thin = thin + rest * rows[j]
            thin = thin - np.abs(rest) * rows[3 + j]
        gap = np.where(thin > plain, thin, plain)
        best = np.where(gap > best, gap, best)
        out[:WIDTH] = np.where(rows[3] < 0.0, np.float32(np.inf), best)
        out[WIDTH : 2 * WIDTH] = square


def _along(rows, frame, probe, axis):
    gap = np.full(WIDTH, probe[6 + axis])
    reach = np.full(WIDTH, probe[9 + axis])
    for j in range(3):
        gap = gap + frame[3 * axis + j] * rows[j]
        reach = reach + np.abs(frame[3 * axis + j]) * rows[3 + j]
    return gap, reach


def _outside(rows, probe, edge):
    out = np.full(WIDTH, probe[edge + 3])
    for j in range(3):
        out = out + probe[edge + j] * rows[j]
        out = out - np.abs(probe[edge + j]) * rows[3 + j]
    return out > 0.0


if not WITH_NUMBA:
    boxes_meeting, boxes_nearest = boxes_meeting_one_by_one, boxes_nearest_one_by_one
    boxes_meeting_prism = boxes_meeting_prism_one_by_one
    boxes_near_place, points_near_place = boxes_near_place_one_by_one, points_near_place_one_by_one
    boxes_within, points_within = boxes_within_one_by_one, points_within_one_by_one
    patches_near_place = patches_near_place_one_by_one
else:
    from collide.kernels.box_vectors import (
        boxes_meeting,
        boxes_meeting_prism,
        boxes_near_place,
        boxes_nearest,
        boxes_within,
        patches_near_place,
        points_near_place,
        points_within,
    )

#: ``boxes_meeting(boxes, at, frame, probe) -> int``: bit k is set unless an axis separates the probe's box from box k
#: of the node whose first float is ``boxes[at]``. Views of float32. `boxes_meeting_prism` reads PRISM floats.
#: ``boxes_within(boxes, at, frame, probe) -> int``: bit k is set unless box k is farther from the probe's box than the
#: root of ``probe[12]``, farther along an axis of the node, or outside of a half-space; of the probe's half lengths in
#: its own frame none is enlarged. `points_within` reads three rows of eight coordinates in place of boxes.
#: ``boxes_nearest(boxes, at, slabs, slab_at, frame, probe, out)``: out becomes eight lower bounds of distances (≤ 0
#: where no axis separates), then eight squared lengths of lines between centres, in units of the probe's tree.
#: ``boxes_near_place(boxes, at, x, y, z, limit) -> int``: bit k is set where the squared distance of box k of the node
#: from a place is at most a limit, floats all, and not of slots that are not used; `points_near_place` reads three rows
#: of eight coordinates. ``patches_near_place(boxes, at, slabs, slab_at, x, y, z, limit, reach)`` leaves out boxes whose
#: slab is farther from the place than a reach, too.
__all__ = [
    "FRAME", "NEAR_PROBE", "PRISM", "PROBE", "boxes_meeting", "boxes_meeting_one_by_one", "boxes_meeting_prism",
    "boxes_meeting_prism_one_by_one", "boxes_near_place", "boxes_near_place_one_by_one", "boxes_nearest",
    "boxes_nearest_one_by_one", "boxes_within", "boxes_within_one_by_one", "patches_near_place",
    "patches_near_place_one_by_one", "points_near_place", "points_near_place_one_by_one", "points_within",
    "points_within_one_by_one",
]
