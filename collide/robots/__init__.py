"""Robots: links, joints, where links stand, and configurations and motions checked many at a time."""
