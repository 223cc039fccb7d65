"""Arithmetic with known errors: error-free transformations, double-doubles, integers of any length, exact signs."""
