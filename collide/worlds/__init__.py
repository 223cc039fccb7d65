"""Worlds: bodies with poses, and who meets whom, how far apart, and in which points."""
