"""Localisation, path following and the drive."""
