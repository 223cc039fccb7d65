"""Certificates: plain data that prove a boolean, made and checked in Python integers. No kernel is imported."""
