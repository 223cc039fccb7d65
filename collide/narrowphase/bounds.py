"""How far rounding can move what the narrowphase computes, and what the answers promise.

Write u = 2⁻⁵³ and, for a pair, t = p_WB − p_WA and

    S = ρ_A + ρ_B + |t| + r_A + r_B (+ |offset| for a half-space),    ρ = reach · stretch of R,

where the stretch is a bound of |R| (`posed_pair.stretch_of`), 1 and a rounding for a rotation, and no row is longer.

1. A difference point w = R_A a − R_B b − t. Each coordinate is two products-and-sums of three terms
   (γ₃ of Σ|R_kj||a_j| ≤ ρ), two subtractions, and t itself rounded once: at most 5u·(ρ_A + ρ_B + |t|)
   a coordinate, so |error of w| ≤ √3·5u·S < 9u·S. Curved supports place the point to 6u·ρ more
   across its normal, and its value along the direction to as much: < 16u·S in all.
2. A plane. Direction d; g = R_Aᵀd is good to 3√3·u·|d|·stretch, the scan's products to γ₃, so the
   vertex chosen is within 2·(3√3 + 3)u·ρ|d| < 17u·ρ|d| of the best one, for each body (one of a support tree,
   settled, is the best one for g exactly). With w·d itself
   rounded (3u·|w||d|) and step 1: every point x of A ⊖ B has x·d/|d| ≥ fl(w·d)/|d| − (16 + 17 + 3 + 2)u·S.
3. A point of A ⊖ B: Σ λ_k w_k with λ ≥ 0 and |Σ λ − 1| ≤ 3u is within (16 + 3 + 4)u·S of a true one.
4. The final sums (± r, ± error) round at most 4u·S.

All of it together stays below 45u·S, and the error used is 64u·S, plus the slop of stored points
and of composed poses (`PackedConvex.slop`, `pose_table`). It holds whatever the matrix, not only for
rotations, since ρ is measured with the matrix given. Where the bracket spans zero, the exact stage
(`settle_hulls.py`) settles the sign.
"""

from __future__ import annotations

#: Error of every bound, in units of S (see above).
ERROR = 64 * 2.0**-53

#: Relative error of a distance that the exact stage hands over in double-doubles: two conversions good to
#: 2⁻⁸⁰ each, a quotient, a root and a quotient more.
EXACT_ERROR = 2.0**-75

#: What that may be off by besides, below the size where a relative error holds: each of two doubles is rounded to a
#: multiple of 5e-324.
SUBNORMAL, SMALLEST_NORMAL = 1e-323, 1e-290

#: `certified` promises a proven sign and a bracket at most this wide, for cores of points: four units in the last
#: place of a gap, and this much of a depth.
PROMISE_GAP, PROMISE_DEPTH = 2.0**-50, 1e-12
#: Four units in the last place of the smallest doubles.
PROMISE_SUBNORMAL = 2e-323
#: The same in units of S for shapes whose stored points are rounded (`PackedConvex.slop`), and for unions of parts.
PROMISE_STORED = 2.0**-40
#: The same where a cylinder, cone or ellipsoid takes part.
PROMISE_CURVED = 2.0**-26

#: Where EPA stops on curved cores, in units of S. Much tighter than the promise, because the witness
#: points are off by about the root of it: 2⁻²⁹ left them 3e-7 of the size outside their bodies. Below 2⁻⁴⁰ the
#: facets get too thin to prove anything with, and one run in twenty ends at its cap.
TOLERANCE_CURVED = 2.0**-36

#: Where it stops first where last digits are asked for, which a coarse surface mostly proves (`gap/curved_depth.py`).
COARSE_CURVED = 2.0**-18

#: A tetrahedron that holds the origin this deep, in units of S, is a seed for EPA.
WELL_CONDITIONED = 2.0**-10

#: Rounds after which GJK hands over the bracket it has.
GJK_ROUNDS = 128
#: Rounds of the exact search; it ends by itself, and no case met needed 20.
EXACT_ROUNDS = 100000
#: Vertices and facets an expanding polytope may use before it hands over the bracket it has.
EPA_VERTICES = 4096
EPA_FACETS = 2 * EPA_VERTICES
