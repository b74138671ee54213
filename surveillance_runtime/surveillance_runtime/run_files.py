"""The names of the files in a run's folder."""

from __future__ import annotations

PLACE = 'place.yaml'
INCIDENTS, TRUTH = 'incidents.jsonl', 'truth.jsonl'
RECORDING, TIMELINE, LAUNCH_LOG = 'recording', 'timeline.jsonl', 'launch.log'
"""In the folder of a run: the place, the recording, its time line, the log of all programs."""
