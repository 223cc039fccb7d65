"""Point clouds against other shapes."""
