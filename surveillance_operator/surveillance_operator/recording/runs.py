"""The folder that a run leaves behind, and how a person names it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NoReturn

from surveillance_operator.recording import timeline
from surveillance_operator.recording.bag import RecordingError

EXIT_BAD_INPUT = 2
LAST = 'last'
RECORD = 'mission.jsonl'
PLACE = 'place.yaml'


def find_run(name: str, runs: Path) -> Path:
    """Return the folder of a run: a path, a name below `runs`, or `last`.

    Raises:
        RecordingError: There is none.
    """
    known = sorted(path.name for path in runs.glob('*') if is_run(path))
    if name == LAST:
        if not known:
            raise RecordingError(f'no run in {runs} yet')
        return runs / known[-1]
    for folder in (Path(name), runs / name, Path(name).parent):
        if is_run(folder):
            return folder
    newest = f', e.g. {known[-1]}, or {LAST}' if known else ''
    raise RecordingError(f'{name}: expected the folder of a run below {runs}{newest}')


def is_run(folder: Path) -> bool:
    """Tell whether a folder holds what a run leaves."""
    return any((folder / file).is_file() for file in (timeline.NAME, RECORD))


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_BAD_INPUT, f'{self.prog.split()[-1]}: {message} (see {self.prog} --help)\n')


def run_parser(name: str, description: str) -> argparse.ArgumentParser:
    """Return the parser of a command about a run; its errors are one line."""
    parser = _Parser(prog=f'launch.py {name}', description=description)
    parser.add_argument(
        'run', nargs='?', default=LAST, metavar='RUN', help='its folder; default: the last one'
    )
    parser.add_argument(
        '--runs', type=Path, default=Path('runs'), metavar='DIR', help='where runs are'
    )
    return parser
