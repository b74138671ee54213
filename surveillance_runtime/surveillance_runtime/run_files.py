"""The names of the files in a run's folder, and the order of runs."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from strict_files.regular_files import parse_json

PLACE, TRUTH = 'place.yaml', 'truth.jsonl'
RECORDING, TIMELINE, LAUNCH_LOG = 'recording', 'timeline.jsonl', 'launch.log'
"""In the folder of a run: the place, what was staged, the recording, its time line, the log of all
programs."""
STATE = 'run.json'
"""What a run was asked for, whether it ended, and its number."""


PARAMETERS, EVIDENCE, OUTBOX, ARMOR_STORE = 'parameters', 'evidence', 'outbox', 'armor_store'
"""Folders of a run: of its nodes, the observer, the node `alarm`, the ontology's server."""
FOLDERS = frozenset({RECORDING, PARAMETERS, EVIDENCE, OUTBOX, ARMOR_STORE})
"""The folders of a run that are no robot's; no robot of a fleet may be called so."""


_A_ROBOT = re.compile('[A-Za-z0-9_]{1,200}')


def folder_of(run: Path, robot: str) -> Path:
    """Return the folder of a robot in that of its run; that of the run where it has none.

    Args:
        run: The run's folder.
        robot: What somebody calls it: anybody may tell of something in any name, it is no path.
    """
    own = run / robot if _A_ROBOT.fullmatch(robot) and robot not in FOLDERS else run
    return own if own.is_dir() else run


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
