"""The exact stage: whether two posed hulls, each swept by a ball, share a point. No rounding at all.

GJK with Johnson's subalgorithm (Gilbert, Johnson and Keerthi 1988) in integers: every quantity is a
polynomial of the doubles given (vertices, both poses, radii), which `geometry.digits` holds exactly.
The exact distance of the simplex strictly decreases from round to round and there are finitely many
simplices, so it ends, and it ends in a decision. Doubles only propose: which simplex to begin with,
and which few vertices can be extreme in a direction (all within an error bound of the best one).

Degrees, with one coordinate of a difference point y = R_A a − R_B b − (p_WB − p_WA) as one: a Gram
entry y_i·y_j has two, Johnson's Δ has 0, 2, 4, 6 for 1 to 4 points, the direction Σ Δ_i y_i one more.
"""
