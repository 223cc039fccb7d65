"""Robots: links and joints, where links stand for joint values, and whole configurations and motions checked at once."""
