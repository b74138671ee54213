"""The map that the robot learns from markers when it starts.

- `initial_scan`: the scan, until the map is whole; `scan_peers`: the arm and the marker server;
- `assembly`: one map from notes about single places (`Survey`, `PlaceNote`), and what is missing.
"""
