"""Pure arrays to numbers: packed convex sets, supports, boxes, exact vertices. Knows no World."""
