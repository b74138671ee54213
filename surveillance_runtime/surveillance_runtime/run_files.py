"""The names of the files in a run's folder."""

from __future__ import annotations

PLACE, TRUTH = 'place.yaml', 'truth.jsonl'
RECORDING, TIMELINE, LAUNCH_LOG = 'recording', 'timeline.jsonl', 'launch.log'
"""In the folder of a run: the place, what was staged, the recording, its time line, the log of all
programs."""
