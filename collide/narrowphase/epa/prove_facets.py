"""Facets of EPA's surface whose side doubles leave open, in double-doubles: slivers, mostly.

One facet that is not known to face outwards leaves the whole surface without a proof. Of curved bodies one in a thousand
runs ended so.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.narrowphase.epa.polytope_surface import FACET
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.numerics.double_double import cross, divide, product_of_vectors, square_root, subtract

#: Error of a determinant in double-doubles, in units of |a|·|b − a|·|c − a| as sums of coordinates.
_DETERMINANT_ERROR = 2.0**-98
#: Bounds are handed over in doubles.
_ROUNDED = 4.0 * 2.0**-53


@kernel
def prove_facets(surface, count):
    """Set the clearance of facets that have none, where the origin lies behind their corners as these stand."""
    points, _, _, clearances, _, facets, _, _, _ = surface
    for f in range(count):
        if clearances[f] < 0.0:
            a = POINT * facets[FACET * f]
            b = POINT * facets[FACET * f + 1]
            c = POINT * facets[FACET * f + 2]
            ax = points[a]
            ay = points[a + 1]
            az = points[a + 2]
            ex, ex_low = subtract(points[b], 0.0, ax, 0.0)
            ey, ey_low = subtract(points[b + 1], 0.0, ay, 0.0)
            ez, ez_low = subtract(points[b + 2], 0.0, az, 0.0)
            fx, fx_low = subtract(points[c], 0.0, ax, 0.0)
            fy, fy_low = subtract(points[c + 1], 0.0, ay, 0.0)
            fz, fz_low = subtract(points[c + 2], 0.0, az, 0.0)
            nx, nx_low, ny, ny_low, nz, nz_low = cross(
                ex, ex_low, ey, ey_low, ez, ez_low, fx, fx_low, fy, fy_low, fz, fz_low
            )
            height, height_low = product_of_vectors(nx, nx_low, ny, ny_low, nz, nz_low, ax, 0.0, ay, 0.0, az, 0.0)
            square, square_low = product_of_vectors(nx, nx_low, ny, ny_low, nz, nz_low, nx, nx_low, ny, ny_low, nz, nz_low)
            length, length_low = square_root(square, square_low)
            if length == 0.0:
                continue
            sides = (abs(ex) + abs(ey) + abs(ez)) * (abs(fx) + abs(fy) + abs(fz))
            unsure = _DETERMINANT_ERROR * (abs(ax) + abs(ay) + abs(az)) * sides
            if height > unsure:
                distance, _ = divide(height, height_low, length, length_low)
                # The normal, too, is unsure, by as much of |e||f|: no corner is nearer along it than this.
                clearances[f] = max(distance * (1.0 - _ROUNDED) - 4.0 * unsure / length, 0.0)
