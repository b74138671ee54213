"""Between the observer's topics and `indoor_watch`: poses by stamps, which picture is next.

`base_history`, `scan_pairing`, `camera_tracker` and `picture_chooser` are plain Python: stamps and
the time are handed in, and the executor's thread owns them. `event_facts_writer` and
`fleet_positions` ask and hear other nodes; `observer_topics` tells.
"""
