"""Whether a cloud of equal balls and a ball meet, at many pairs of poses: a walk down the tree with floats.

The other ball's centre is seen in the cloud's frame, off by no more than a slack: what is farther than both radii and
the slack misses, what is nearer than both radii less the slack hits. Points stand in the tree as floats; where these do
not tell, the doubles are looked at, and a pose that these leave open is left to the caller.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.fields.point_tree_kernel import FLOAT_ERROR, LEAF_FLOATS, MAX_LEVELS, floats_of, points_of
from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.shape_table import POSE
from collide.mesh.box_overlap import boxes_near_place, points_near_place
from collide.mesh.bvh import CENTRE, EXPONENT, MAX_LEAF, NODE, REACH, WIDTH, link_of, open_tree
from collide.narrowphase.pose_batches import set_pose
from collide.numerics.rigid_poses import off_rotation
from collide.numerics.vec3 import Vec3, add, dot, norm1, rotate, rotate_back, scale, sub, vec3_at

#: What becomes of a pair of poses.
APART, MEETS, OPEN = range(3)
#: Of the numbers met, what rounding moves a place by.
_ROUNDING = 2.0**-44
#: The same where squares are worked out in floats, and what these hold.
_FLOAT_ROUNDING, _LARGEST_FLOAT = 2.0**-20, 2.0**120
#: Words of workspace: two poses, the walk's stack.
WORK = 2 * POSE + WIDTH * (MAX_LEVELS + 1)


class _Look(NamedTuple):
    """A place to look around, and how far.

    x : in units from the tree's centre.   y : in the cloud's frame [m].   far, near : squared distances, in units, of
    floats that miss, and hit, for sure.   radii, slack : [m].
    """

    x: Vec3
    y: Vec3
    far: float
    near: float
    radii: float
    slack: float


@kernel
def _state(tree, look, stack):
    """APART, MEETS or OPEN."""
    floats, points, x = floats_of(tree), points_of(tree), look.x
    fx, fy, fz, far = np.float32(x.x), np.float32(x.y), np.float32(x.z), np.float32(look.far)
    stack[0] = 0
    state, top = APART, 1
    while top > 0:
        top -= 1
        link = link_of(tree.links, stack[top])
        if link >= 0:
            near = boxes_near_place(tree.boxes, NODE * link, fx, fy, fz, far)
            for slot in range(WIDTH):
                if near >> slot & 1:
                    stack[top] = WIDTH * link + slot
                    top += 1
            continue
        run = ~link
        first = run >> 3
        leaf = LEAF_FLOATS * (first // MAX_LEAF)
        near = points_near_place(floats, leaf, fx, fy, fz, far)
        if near == 0:
            continue
        for i in range(run & 7):
            if not near >> i & 1:
                continue
            dx = x.x - float(floats[leaf + i])
            dy = x.y - float(floats[leaf + WIDTH + i])
            dz = x.z - float(floats[leaf + 2 * WIDTH + i])
            if dx * dx + dy * dy + dz * dz < look.near:
                return MEETS
            d = sub(vec3_at(points, 3 * int(tree.ids[first + i])), look.y)
            length = math.sqrt(dot(d, d))
            if length < look.radii - look.slack:
                return MEETS
            if not length > look.radii + look.slack:
                state = OPEN
    return state


@entry("int64(int64, float64, int64, float64, int64, int64, int64, int64, int64, boolean, int64, int64)")
def clouds_meet_balls(
    tree_at, radius, centre_at, other_radius, XA_at, step_a, XB_at, step_b, n, check, states_at, work_at
):
    """APART, MEETS or OPEN of n pairs of poses, a byte each; returns n, or the number of a pose that is none.

    radius : of the cloud's balls [m].   centre, other_radius : of the ball, in the frame of its shape.
    XA, XB : matrices of the cloud and of the shape; step 16 or, for a single pose, 0.   check : refuse matrices other
    than rotations.   work : WORK words.
    """
    tree, poses = open_tree(tree_at), view_f64(work_at, 2 * POSE)
    states, centre = view_u8(states_at, n), vec3_at(view_f64(centre_at, 3), 0)
    stack, off = view_i64(work_at + 16 * POSE, WIDTH * (MAX_LEVELS + 1)), 0.0
    for k in range(n):
        if step_a != 0 or k == 0:
            if not set_pose(poses, 0, view_f64(XA_at + 8 * step_a * k, 16), check):
                return k
            off = off_rotation(poses, 0)
        if (step_b != 0 or k == 0) and not set_pose(poses, POSE, view_f64(XB_at + 8 * step_b * k, 16), check):
            return k
        states[k] = state_of_balls(tree, poses, centre, radius + other_radius, 0.0, off, stack)
    return n


@kernel(inline=True)
def state_of_balls(tree, poses, centre, radii, slop, off, stack):
    """APART, MEETS or OPEN of the balls of a tree at the first of two poses and a ball at the second.

    radii : of both, and a margin [m].   slop : how far places may be off besides rounding [m].   off : how far the
    first pose is off a rotation.
    """
    unit, reach = math.ldexp(1.0, int(tree.header[EXPONENT])), norm1(vec3_at(tree.numbers, REACH))
    c = add(rotate(poses, POSE, centre), vec3_at(poses, POSE + 9))
    y = rotate_back(poses, 0, sub(c, vec3_at(poses, 9)))
    size = reach + radii + norm1(centre) + norm1(vec3_at(poses, 9)) + norm1(vec3_at(poses, POSE + 9))
    slack = (_ROUNDING + 8.0 * off) * size + slop
    x = scale(1.0 / unit, sub(y, vec3_at(tree.numbers, CENTRE)))
    farthest = (radii + slack) / unit + FLOAT_ERROR + _FLOAT_ROUNDING * (1.0 + norm1(x))
    nearest = (radii - slack) / unit - FLOAT_ERROR - _ROUNDING * (1.0 + norm1(x))
    far, near = farthest * farthest * (1.0 + _FLOAT_ROUNDING), nearest * nearest if nearest > 0.0 else -1.0
    return _state(tree, _Look(x, y, far, near, radii, slack), stack) if far < _LARGEST_FLOAT else OPEN
