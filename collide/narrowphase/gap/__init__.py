"""The last digits of a gap between two convex sets, in double-doubles, from the feature that GJK found."""
