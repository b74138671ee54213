"""The names of the files in a run's folder, and the order of runs."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from strict_files.regular_files import parse_json

PLACE, TRUTH = 'place.yaml', 'truth.jsonl'
RECORDING, TIMELINE, LAUNCH_LOG = 'recording', 'timeline.jsonl', 'launch.log'
"""In the folder of a run: the place, what was staged, the recording, its time line, the log of all
programs."""
STATE = 'run.json'
"""What a run was asked for, whether it ended, and its number."""


def run_number(folder: Path) -> int:
    """Return the number of a run, which grows with each start; 0: it has none.

    The date in a folder's name says less: a clock may be behind, or be set back.
    """
    try:
        descriptor = os.open(folder / STATE, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return 0
    try:
        number = parse_json(os.read(descriptor, 1_000_000)).get('number', 0)
        return number if isinstance(number, int) else 0
    except (OSError, ValueError, AttributeError):
        return 0
    finally:
        os.close(descriptor)


def in_order(folders: Iterable[Path]) -> list[Path]:
    """Return runs in the order in which they were started last; those without a number first."""
    return sorted(folders, key=lambda folder: (run_number(folder), folder.name))
