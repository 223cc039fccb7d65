"""Worlds as sensors give them: points in trees."""
