"""GJK and MPR on the Minkowski difference: proposals in doubles, with bounds."""
