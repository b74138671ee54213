"""Paths on a grid map."""
