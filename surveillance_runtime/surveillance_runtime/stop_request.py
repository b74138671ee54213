"""A person's wish that the robot stands: who has it, since when, and the file that keeps it.

The wish stands until a person releases the robot. It is kept in the user's state folder, by the
ROS domain and the robot's namespace, and not with a run: another command, another place or another
option starts a robot that is stopped, too.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import stat
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from strict_files.files import FileError, in_one_line, read_json
from strict_files.regular_files import replace_file

TOPIC = 'stop_requested'
"""Where a wish is told: by page, console, view, or a hardware button."""
OWN = 'auto'
"""In place of a file's name: the robot's own, in the user's state folder."""
LONGEST_TEXT = 200
"""Letters that are kept of a name or a reason: anybody may send one."""
_LARGEST = 10_000
_LATEST = 1e11
"""A time from here on, in seconds of UNIX time, is none: the file is damaged."""


@dataclass(frozen=True)
class StopRequest:
    """A wish that the robot stands.

    Attributes:
        owner: Who has it; empty: nobody said.
        reason: Why; empty: nobody said.
        since: When it came, seconds of UNIX time.
    """

    owner: str
    reason: str
    since: float

    @classmethod
    def heard(cls, owner: str, reason: str) -> StopRequest:
        """Return the wish that somebody has just told, its words in one line."""
        return cls(_in_one_line(owner), _in_one_line(reason), time.time())

    def words(self) -> str:
        """Return who stopped the robot, when, and why."""
        at = time.strftime('%H:%M on %Y-%m-%d', time.localtime(self.since))
        by = f' by {self.owner}' if self.owner else ''
        return f'stopped{by} at {at}' + (f' ({self.reason})' if self.reason else '')


def _in_one_line(text: str) -> str:
    """Return a stranger's text without line breaks and control characters, at most 200 letters."""
    return ''.join(each if each.isprintable() else ' ' for each in text[:LONGEST_TEXT]).strip()


def own_stop(domain: int, namespace: str, environ: Mapping[str, str]) -> StopFile:
    """Return what keeps a robot's stop on this machine; see `own_file`."""
    file = own_file(domain, namespace, environ)
    memory = environ.get('XDG_RUNTIME_DIR') or f'/run/user/{os.getuid()}'
    if not os.path.isdir(memory):
        # Its name is known to all users of the machine: one of them may have made it.
        memory = os.path.join(tempfile.gettempdir(), f'surveillance_{os.getuid()}')
        if not _is_private(Path(memory)):
            return StopFile(file)
    return StopFile(file, Path(memory, 'surveillance', file.name))


def _is_private(folder: Path) -> bool:
    """Make a folder that nobody else may write into; tell whether it is one."""
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        return (
            stat.S_ISDIR(found.st_mode)
            and found.st_uid == os.getuid()
            and (not stat.S_IMODE(found.st_mode) & 0o022)
        )
    return False


def own_file(domain: int, namespace: str, environ: Mapping[str, str]) -> Path:
    """Return the file in which a robot's stop is kept on this machine.

    Args:
        domain: The ROS domain.
        namespace: Of the robot, `/` for none.
        environ: The environment: `XDG_STATE_HOME` names the state folder, else ~/.local/state.
    """
    state = environ.get('XDG_STATE_HOME') or os.path.expanduser('~/.local/state')
    # Two robots, a/b and a_b, have two files.
    robot = re.sub(r'[^\w.]', '_', namespace.strip('/').replace('/', '.'))
    name = f'stop_{domain}_{robot}.json' if robot else f'stop_{domain}.json'
    return Path(state, 'surveillance', name)


class StopFile:
    """Keeps a wish over the end of every process; each call waits for the disk.

    Args:
        path: The file; None: nothing is kept.
        spare: A file in memory, which lasts until the machine is switched off: written first, and
            left where the other one cannot be written; None: there is none.
    """

    def __init__(self, path: Path | None, spare: Path | None = None) -> None:
        self.path = path
        self.spare = None if spare == path else spare

    def read(self) -> StopRequest | None:
        """Return the wish that is kept; None where there is none.

        A file that cannot be read stops the robot as well: that it was released is not known.
        """
        files = (self.path, self.spare)
        return next(filter(None, (_read(each) for each in files if each is not None)), None)

    def keep(self, request: StopRequest) -> str:
        """Write the wish; return what it does not outlive, and why, or ''."""
        if self.path is None:
            return 'not over a restart: no file is given for it'
        content = {'owner': request.owner, 'reason': request.reason, 'since': request.since}
        words = json.dumps(content).encode() + b'\n'
        in_memory = self.spare is not None and not _write(self.spare, words, durable=False)
        problem = _write(self.path, words, durable=True)
        if not problem:
            if self.spare is not None:
                _remove(self.spare)
            return ''
        lost = 'once the machine was off' if in_memory else 'over a restart'
        return f'not {lost}: {problem}'

    def forget(self) -> str:
        """Remove the wish; return why it is still kept, or ''."""
        files = (self.path, self.spare)
        return next(filter(None, [_remove(each) for each in files if each is not None]), '')


def _read(path: Path) -> StopRequest | None:
    try:
        found = read_json(path, _LARGEST)
        if found is None:
            return None
        owner, reason, since = (found[each] for each in ('owner', 'reason', 'since'))
        if not 0.0 <= float(since) < _LATEST:
            raise ValueError(f'since {since!r:.20}, expected a time')
        return StopRequest(_in_one_line(str(owner)), _in_one_line(str(reason)), float(since))
    except (FileError, KeyError, TypeError, ValueError) as error:
        return StopRequest('', f'{path} cannot be read: {error}', time.time())


def _write(path: Path, words: bytes, *, durable: bool) -> str:
    """Write a file; return why that failed, or ''."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, words, durable=durable)
    except OSError as error:
        return in_one_line(error)
    return ''


def _remove(path: Path) -> str:
    """Remove a file; return why it is still there, or ''."""
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            path.unlink()
    except OSError as error:
        return in_one_line(error)
    return ''
