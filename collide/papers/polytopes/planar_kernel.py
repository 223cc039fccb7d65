"""Pairs of posed polygons, many in one call: addresses in, rows of `planar_layout.py` out."""

from __future__ import annotations

from collide.kernels import entry, view_f64, view_i64
from collide.papers.polytopes.planar_layout import DOUBLES, INTEGERS, ROW, SWAPPED
from collide.papers.polytopes.planar_predicates import PolygonPair, set_planar_poses
from collide.papers.polytopes.planar_search import search_planar


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def meet_polygons(
    polygons_a, step_a, poses_a, pose_step_a, polygons_b, step_b, poses_b, pose_step_b, n, out, doubles, integers
):
    """Answer n pairs.

    polygons_a, polygons_b : addresses of rows (address of coordinates, number of vertices).   poses_a, poses_b :
    addresses of matrices (3, 3). Pair k takes row k·step of each: steps are 1, or 0 where one goes with all.
    doubles, integers : addresses of workspaces of DOUBLES and INTEGERS.
    """
    rows = view_i64(out, ROW * n)
    work = view_f64(doubles, DOUBLES)
    digits = view_i64(integers, INTEGERS)
    for k in range(n):
        a = view_i64(polygons_a + 16 * step_a * k, 2)
        b = view_i64(polygons_b + 16 * step_b * k, 2)
        pose_a = view_f64(poses_a + 72 * pose_step_a * k, 9)
        pose_b = view_f64(poses_b + 72 * pose_step_b * k, 9)
        # A Q of fewer than three vertices is searched only by a P that has no more.
        swapped = b[1] < 3 and a[1] > b[1]
        if swapped:
            a, b = b, a
            pose_a, pose_b = pose_b, pose_a
        set_planar_poses(work, pose_a, pose_b)
        pair = PolygonPair(view_f64(a[0], 2 * a[1]), a[1], view_f64(b[0], 2 * b[1]), b[1], work, digits)
        search_planar(pair, rows, ROW * k)
        rows[ROW * k + SWAPPED] = 1 if swapped else 0
