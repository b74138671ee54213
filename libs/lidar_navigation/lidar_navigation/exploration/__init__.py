"""A robot in a building that it does not know: it drives where nobody has looked, and maps it.

`scan_matching` finds from where a scan was made, `pose_graph` makes what was found agree,
`evidence_grid` draws the map and `map_building` does all three with each scan. `frontiers` says
where the known ends, and `exploration` drives there.
"""
