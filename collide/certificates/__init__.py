"""Certificates: plain data that prove a boolean, made here and checked in Python integers."""
