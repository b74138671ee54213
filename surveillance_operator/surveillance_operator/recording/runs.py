"""The folder that a run leaves behind, and how a person names it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from strict_files.files import FileError, like_file
from strict_files.suggestions import like
from surveillance_operator.recording.reading import SUFFIX, files_of
from surveillance_runtime.command_line import CommandParser
from surveillance_runtime.event_log import record_in
from surveillance_runtime.run_files import LAUNCH_LOG, PLACE, RECORDING, TIMELINE, in_order

LAST = 'last'


def find_run(name: str, runs: Path) -> Path:
    """Return the folder of a run: a path, a name below `runs`, or `last`.

    Raises:
        FileError: There is none.
    """
    known = [path.name for path in in_order(path for path in runs.glob('*') if is_run(path))]
    if name == LAST:
        if not known:
            raise FileError(f'no run in {runs} yet')
        return runs / known[-1]
    given = Path(name)
    # A file or folder of a run stands for the run.
    holder = [given.parent] if given.exists() else []
    for folder in (given, runs / name, *holder):
        if is_run(folder):
            return folder
    likely = like(given.name, known) or like_file(given) or (known[-1] if known else '')
    example = f', e.g. {likely}' if likely else ''
    last = f', or {LAST}' if known else ''
    raise FileError(f'{name}: expected the folder of a run below {runs}{example}{last}')


@dataclass(frozen=True)
class Recording:
    """What there is to replay.

    Attributes:
        name: Where it is.
        timeline: Where its time line is, or is to be kept.
        messages: The folder or file of its messages, if there are any.
        is_whole: Whether it has its time line.
        log: What happened; None: another program recorded it.
        robot: Whose it is; empty: of a robot that was alone.
    """

    name: Path
    timeline: Path
    messages: Path | None
    is_whole: bool
    log: Path | None = None
    robot: str = ''

    @property
    def run(self) -> Path:
        """The folder of the run."""
        return (self.name.parent if self.robot else self.name).resolve()


def find_recordings(name: str, runs: Path) -> dict[str, Recording]:
    """Return the recordings of a run by its robots, or the one that another program wrote.

    A robot that was alone has no name.

    Raises:
        FileError: There is none.
    """
    given = Path(name)
    if given.suffix == SUFFIX and given.is_file():
        return {'': _foreign(given, given)}
    if given.is_dir() and not is_run(given) and not is_run(given.parent):
        return {'': _foreign(given, files_of(given)[0].parent)}
    folder = find_run(name, runs)
    found = {robot: _recorded(own, robot) for robot, own in robots_of(folder).items()}
    recordings = {robot: each for robot, each in found.items() if each is not None}
    if not recordings:
        raise FileError(f'{folder}: nothing was recorded')
    return recordings


def _recorded(folder: Path, robot: str) -> Recording | None:
    """Return what there is to replay of one robot's run."""
    line, recorded = folder / TIMELINE, folder / RECORDING
    has_messages = recorded.is_dir() and any(recorded.glob(f'*{SUFFIX}'))
    if not line.is_file() and not has_messages:
        return None
    messages = recorded if has_messages else None
    return Recording(folder, line, messages, line.is_file(), record_in(folder), robot)


def _foreign(name: Path, messages: Path) -> Recording:
    """Return what another program recorded; the time line from an earlier look lies beside it."""
    whole = messages.resolve()
    line = whole.with_name(f'{whole.name}.{TIMELINE}')
    newest = max(path.stat().st_mtime for path in files_of(messages))
    return Recording(name, line, messages, line.is_file() and line.stat().st_mtime > newest)


def is_run(folder: Path) -> bool:
    """Tell whether a folder holds what a run leaves."""
    return bool(robots_of(folder))


def robots_of(folder: Path) -> dict[str, Path]:
    """Return the folder of each robot of a run; a robot that was alone has no name.

    One of a fleet that left nothing but its copy of the place is named, too.
    """
    # What a fleet shares has a log of its own in the folder of the run.
    if any((folder / file).is_file() for file in (PLACE, LAUNCH_LOG)):
        below = sorted(folder.iterdir())
        if any(map(_is_of_robot, below)):
            return {own.name: own for own in below if _is_of_robot(own) or (own / PLACE).is_file()}
    return {'': folder} if _is_of_robot(folder) else {}


def _is_of_robot(folder: Path) -> bool:
    return (folder / TIMELINE).is_file() or record_in(folder).is_file()


def run_parser(name: str, description: str) -> CommandParser:
    """Return the parser of a command about a run."""
    parser = CommandParser(prog=f'launch.py {name}', description=description)
    parser.add_argument(
        'run', nargs='?', default=LAST, metavar='RUN', help='its folder; default: the last one'
    )
    parser.add_argument(
        '--runs', type=Path, default=Path('runs'), metavar='DIR', help='where runs are'
    )
    return parser
