"""The nearest point of a simplex that has just grown by one point.

Before, the origin's nearest point lay in the midst of all the old points; so the new one is the newest point, or lies
on an edge or a face at it. Looking at these alone takes two thirds of the time that `simplex.nearest_in_simplex` takes
for all faces, but rounding may have another face hold it: a prototype that trusted it was wrong by many lengths. So
the result is checked: a point v of the simplex is its nearest one if no corner p has p·v < v·v. Where that is not so,
or where the origin may lie inside, the caller looks at all faces.

Points are passed as numbers: what the compiler can keep in registers it need not store and load again.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.gjk.simplex import height_behind

#: How far, relatively, the square of a length may be from the least product of a corner with it.
_OPTIMAL = 1.0 - 2.0**-40


@kernel(inline=True)
def with_newest(n, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz, error, slack):
    """(kept, turn, weights of D and two more, x, y, z, its square) for n old points A, B, C and the newest, D.

    kept : how many points stay, D and the first ones of (A, B, C), (B, C, A) or (C, A, B), as ``turn`` says. 0: look
        at all faces. 4: the origin lies in the tetrahedron; the weight of D is how deep, at least.
    error : how far each point may be from its true place.   slack : how far a square may be off.
    """
    if n == 1:
        kept, turn, wd, wf, ws, x, y, z = _on_segment(ax, ay, az, dx, dy, dz)
    elif n == 2:
        kept, turn, wd, wf, ws, x, y, z = _on_triangle(ax, ay, az, bx, by, bz, dx, dy, dz)
    else:
        kept, turn, wd, wf, ws, x, y, z = _on_tetrahedron(ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz, error)
    square = x * x + y * y + z * z
    least = min(x * dx + y * dy + z * dz, x * ax + y * ay + z * az)
    if n > 1:
        least = min(least, x * bx + y * by + z * bz)
    if n > 2:
        least = min(least, x * cx + y * cy + z * cz)
    if kept < 4 and not least >= square * _OPTIMAL - slack:
        kept = 0
    return kept, turn, wd, wf, ws, x, y, z, square


@kernel(inline=True)
def pick(turn, a, b, c):
    """One of three, as ``turn`` says."""
    return a if turn == 0 else (b if turn == 1 else c)


@kernel(inline=True)
def _on_segment(ax, ay, az, dx, dy, dz):
    """`with_newest` of a segment."""
    ex = ax - dx
    ey = ay - dy
    ez = az - dz
    along = -(dx * ex + dy * ey + dz * ez)
    if along <= 0.0:
        return 1, 0, 1.0, 0.0, 0.0, dx, dy, dz
    w = min(along / (ex * ex + ey * ey + ez * ez), 1.0)
    return 2, 0, 1.0 - w, w, 0.0, dx + w * ex, dy + w * ey, dz + w * ez


@kernel(inline=True)
def _on_triangle(ax, ay, az, bx, by, bz, dx, dy, dz):
    """`with_newest` of a triangle."""
    ex = ax - dx
    ey = ay - dy
    ez = az - dz
    fx = bx - dx
    fy = by - dy
    fz = bz - dz
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    within, wf, ws = _shares(
        nx, ny, nz, dy * ez - dz * ey, dz * ex - dx * ez, dx * ey - dy * ex, dy * fz - dz * fy, dz * fx - dx * fz, dx * fy - dy * fx
    )
    if within:
        return _on_face(0, wf, ws, dx, dy, dz, ex, ey, ez, fx, fy, fz)
    p = -(dx * ex + dy * ey + dz * ez)
    q = -(dx * fx + dy * fy + dz * fz)
    if p <= 0.0 and q <= 0.0:
        return 1, 0, 1.0, 0.0, 0.0, dx, dy, dz
    ee = ex * ex + ey * ey + ez * ez
    ff = fx * fx + fy * fy + fz * fz
    if q <= 0.0 or (p > 0.0 and p * p * ff >= q * q * ee):
        w = min(p / ee, 1.0)
        return 2, 0, 1.0 - w, w, 0.0, dx + w * ex, dy + w * ey, dz + w * ez
    w = min(q / ff, 1.0)
    return 2, 1, 1.0 - w, w, 0.0, dx + w * fx, dy + w * fy, dz + w * fz


@kernel(inline=True)
def _on_tetrahedron(ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz, error):
    """`with_newest` of a tetrahedron."""
    ex = ax - dx
    ey = ay - dy
    ez = az - dz
    fx = bx - dx
    fy = by - dy
    fz = bz - dz
    gx = cx - dx
    gy = cy - dy
    gz = cz - dz
    # Normals of the faces (A, B), (B, C), (C, A) at D.
    lx = ey * fz - ez * fy
    ly = ez * fx - ex * fz
    lz = ex * fy - ey * fx
    mx = fy * gz - fz * gy
    my = fz * gx - fx * gz
    mz = fx * gy - fy * gx
    nx = gy * ez - gz * ey
    ny = gz * ex - gx * ez
    nz = gx * ey - gy * ex
    volume = lx * gx + ly * gy + lz * gz
    turned = -1.0 if volume < 0.0 else 1.0
    l_sees = turned * (lx * dx + ly * dy + lz * dz) > 0.0
    m_sees = turned * (mx * dx + my * dy + mz * dz) > 0.0
    n_sees = turned * (nx * dx + ny * dy + nz * dz) > 0.0
    if not (l_sees or m_sees or n_sees):
        deep = _behind(-turned, lx, ly, lz, dx, dy, dz, ax, ay, az, bx, by, bz, error)
        deep = min(deep, _behind(-turned, mx, my, mz, dx, dy, dz, bx, by, bz, cx, cy, cz, error))
        deep = min(deep, _behind(-turned, nx, ny, nz, dx, dy, dz, cx, cy, cz, ax, ay, az, error))
        ux = fx - ex
        uy = fy - ey
        uz = fz - ez
        vx = gx - ex
        vy = gy - ey
        vz = gz - ez
        wx = uy * vz - uz * vy
        wy = uz * vx - ux * vz
        wz = ux * vy - uy * vx
        deep = min(deep, _behind(turned, wx, wy, wz, ax, ay, az, bx, by, bz, cx, cy, cz, error))
        deep = math.sqrt(max(deep, 0.0))
        return 4 if deep > error else 0, 0, deep, 0.0, 0.0, dx, dy, dz
    if volume == 0.0:
        return 0, 0, 0.0, 0.0, 0.0, dx, dy, dz
    ux = dy * ez - dz * ey
    uy = dz * ex - dx * ez
    uz = dx * ey - dy * ex
    vx = dy * fz - dz * fy
    vy = dz * fx - dx * fz
    vz = dx * fy - dy * fx
    wx = dy * gz - dz * gy
    wy = dz * gx - dx * gz
    wz = dx * gy - dy * gx
    if l_sees:
        within, wf, ws = _shares(lx, ly, lz, ux, uy, uz, vx, vy, vz)
        if within:
            return _on_face(0, wf, ws, dx, dy, dz, ex, ey, ez, fx, fy, fz)
    if m_sees:
        within, wf, ws = _shares(mx, my, mz, vx, vy, vz, wx, wy, wz)
        if within:
            return _on_face(1, wf, ws, dx, dy, dz, fx, fy, fz, gx, gy, gz)
    if n_sees:
        within, wf, ws = _shares(nx, ny, nz, wx, wy, wz, ux, uy, uz)
        if within:
            return _on_face(2, wf, ws, dx, dy, dz, gx, gy, gz, ex, ey, ez)
    # The edge along which the way to D is shortened most, its square by along² / |edge|².
    along = max(-(dx * ex + dy * ey + dz * ez), 0.0)
    edge = ex * ex + ey * ey + ez * ez
    turn = 0
    p = max(-(dx * fx + dy * fy + dz * fz), 0.0)
    q = fx * fx + fy * fy + fz * fz
    if p * p * edge > along * along * q:
        along, edge, turn = p, q, 1
    p = max(-(dx * gx + dy * gy + dz * gz), 0.0)
    q = gx * gx + gy * gy + gz * gz
    if p * p * edge > along * along * q:
        along, edge, turn = p, q, 2
    if along == 0.0:
        return 1, 0, 1.0, 0.0, 0.0, dx, dy, dz
    w = min(along / edge, 1.0)
    x = dx + w * pick(turn, ex, fx, gx)
    y = dy + w * pick(turn, ey, fy, gy)
    z = dz + w * pick(turn, ez, fz, gz)
    return 2, turn, 1.0 - w, w, 0.0, x, y, z


@kernel(inline=True)
def _behind(turned, nx, ny, nz, ax, ay, az, bx, by, bz, cx, cy, cz, error):
    """h² / |n|² for the normal n of a triangle, turned outwards: see `height_behind`; −1 unless the origin lies behind."""
    height, square = height_behind(
        turned * nx, turned * ny, turned * nz, ax, ay, az, bx, by, bz, cx, cy, cz, error
    )
    return height * height / square if height > 0.0 else -1.0


@kernel(inline=True)
def _shares(nx, ny, nz, ux, uy, uz, vx, vy, vz):
    """(whether the foot lies within a triangle, weights of its second and third corner).

    n : e × f, the edges from the first corner d to the others.   u, v : d × e and d × f.
    """
    whole = nx * nx + ny * ny + nz * nz
    first = -(nx * vx + ny * vy + nz * vz)
    second = nx * ux + ny * uy + nz * uz
    return first > 0.0 and second > 0.0 and first + second < whole, first / whole, second / whole


@kernel(inline=True)
def _on_face(turn, wf, ws, dx, dy, dz, ex, ey, ez, fx, fy, fz):
    x = dx + wf * ex + ws * fx
    y = dy + wf * ey + ws * fy
    z = dz + wf * ez + ws * fz
    return 3, turn, 1.0 - wf - ws, wf, ws, x, y, z
