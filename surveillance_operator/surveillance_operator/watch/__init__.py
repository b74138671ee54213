"""The view of a mission in a terminal.

Begin with `view`: a function for each part of the picture, and the keys. `raster` draws the map in
characters.
"""
