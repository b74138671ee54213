"""The folder of a run: what it was asked for, whether it ended, and which old ones are kept.

`run.json` holds the options of the run and is locked as long as its launcher lives. So a launcher
finds the run of one that was killed, and goes on in its folder: the record, the ontology's store
and the levels of the nodes are there.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from launcher.run import NOT_RECORDED, Run
from strict_files.regular_files import parse_json
from strict_files.suggestions import like
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.run_files import STATE, in_order, run_number


@dataclass(frozen=True)
class Found:
    """A run that was begun.

    Attributes:
        folder: Its folder.
        options: What it was asked for.
        ended: Whether its launcher came to its end.
        running: Whether its launcher still runs.
    """

    folder: Path
    options: Mapping[str, Any]
    ended: bool
    running: bool


class RunState:
    """Holds a folder's `run.json` for the launcher that works in it.

    Args:
        folder: The run's folder.
        options: What the run is asked for, as JSON can hold it.

    Raises:
        NotNowError: Another launcher works in the folder.
        OSError: It cannot be written; the folder is gone if nothing was in it.
    """

    def __init__(self, folder: Path, options: Mapping[str, Any]) -> None:
        self._options = dict(options)
        # Who is started last is gone on with, whatever the clock says.
        self._number = 1 + max(map(run_number, _folders(folder.absolute().parent)), default=0)
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        self._descriptor = os.open(folder / STATE, flags, 0o644)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._descriptor)
            raise NotNowError(f'{folder}: this run is still going on') from None
        try:
            self._write(ended=False)
        except OSError as error:  # a full disk, on which a service begins again and again
            if not os.fstat(self._descriptor).st_size:
                (folder / STATE).unlink()
                with contextlib.suppress(OSError):  # something else is in it
                    folder.rmdir()
            os.close(self._descriptor)
            raise OSError(error.errno, error.strerror, str(folder / STATE)) from None

    def end(self, *, ended: bool = True) -> None:
        """Let go of the folder; where the run has not ended, the next launcher goes on with it."""
        if ended:
            with contextlib.suppress(OSError):  # a full disk
                self._write(ended=True)
        os.close(self._descriptor)

    def _write(self, *, ended: bool) -> None:
        content = {'options': self._options, 'ended': ended, 'number': self._number}
        text = json.dumps(content, indent=1) + '\n'
        os.pwrite(self._descriptor, text.encode(), 0)
        os.ftruncate(self._descriptor, len(text.encode()))


def make_folder(runs: Path) -> Path:
    """Make a new folder for what a run leaves behind.

    Raises:
        NotNowError: It cannot be made.
    """
    stamp = time.strftime('%Y%m%d-%H%M%S')
    for suffix in ('', *(f'-{number}' for number in range(2, 100))):
        folder = runs / (stamp + suffix)
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise NotNowError(f'{folder}: cannot be made: {error.strerror}') from None
        return folder
    raise NotNowError(f'{folder}: a hundred runs began in this second')


def look_into(folder: Path) -> Found | None:
    """Return what a folder says of its run, None where it holds none."""
    try:
        descriptor = os.open(folder / STATE, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        stored = parse_json(os.read(descriptor, 1_000_000))
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            running = False
        except OSError:
            running = True
        return Found(folder, dict(stored['options']), bool(stored['ended']), running)
    except (ValueError, KeyError, TypeError):
        return None
    finally:
        os.close(descriptor)


def latest(runs: Path) -> Found | None:
    """Return the run that was started last, None where there is none."""
    found = (look_into(folder) for folder in reversed(in_order(_folders(runs))))
    return next((each for each in found if each is not None), None)


def damaged(runs: Path, found: Found | None) -> str:
    """Return which run cannot be gone on with, since its `run.json` is damaged; empty: none.

    Args:
        runs: The folder of the runs.
        found: The run that was started last, as far as is known; only later ones are named.
    """
    since = _changed(found.folder) if found is not None else 0.0
    for folder in reversed(in_order(_folders(runs))):
        if _changed(folder) > since and look_into(folder) is None:
            return f'{folder / STATE} is damaged: that run is not gone on with'
    return ''


def _changed(folder: Path) -> float:
    """Return when a folder's `run.json` was written, seconds since 1970; 0: it has none."""
    try:
        return os.lstat(folder / STATE).st_mtime
    except OSError:
        return 0.0


def find(runs: Path, name: str) -> Found:
    """Return the run of a name (or path), or the one that was started last where the name is empty.

    Raises:
        ValueError: There is none.
        NotNowError: It is still going on.
    """
    if name:
        folder = Path(name) if Path(name).is_dir() else runs / name
        found = look_into(folder)
    else:
        folder, found = runs, latest(runs)
    if found is None:
        likely = like(name, (each.name for each in _folders(runs)))
        there = f'{likely!r}' if likely else 'the name of a folder there'
        expected = there if name else 'a run that can be gone on with'
        raise ValueError(f'--resume: no run in {folder}: expected {expected}')
    if found.running:
        raise NotNowError(f'--resume: {found.folder}: this run is still going on')
    return found


def options_of(run: Run) -> dict[str, Any]:
    """Return what a run is asked for, as JSON holds it."""
    options: dict[str, Any] = json.loads(json.dumps(vars(run), default=str))
    return options


def run_from(options: Mapping[str, Any]) -> Run:
    """Return the run of options that `options_of` gave.

    Raises:
        ValueError: They are not of a run.
    """
    known = get_type_hints(Run)
    try:
        values = {name: options[name] for name in options if name in known}
        for name in values:
            if known[name] == Path | None:
                values[name] = Path(values[name]) if values[name] else None
            elif not _fits(values[name], known[name]):
                raise ValueError(f'--resume: {name}: {values[name]!r:.60} is none of its values')
        return Run(**values)
    except TypeError as error:
        raise ValueError(f'--resume: {error}') from None


def _fits(value: Any, kind: Any) -> bool:
    """Tell whether a value of JSON is one that a field of `Run` may have."""
    if isinstance(kind, UnionType):
        return any(_fits(value, each) for each in get_args(kind))
    if get_origin(kind) is Sequence:
        return isinstance(value, list | tuple) and all(isinstance(each, str) for each in value)
    if kind is float:
        return type(value) in (int, float) and math.isfinite(value)
    return type(value) is kind


def resumed(run: Run, usual: Run, runs: Path, name: str) -> tuple[Run, Path]:
    """Return the run to go on with and its folder.

    Args:
        run: What the command line asks for now; it goes before what the run was asked for.
        usual: What a command line without options asks for.
        runs: The folder of the runs.
        name: Of the run; empty: the last one.

    Raises:
        ValueError: There is no such run.
    """
    if run.record not in (None, NOT_RECORDED):
        runs = Path(run.record)
    found = find(runs, name)
    given = {name: value for name, value in vars(run).items() if value != getattr(usual, name)}
    return replace(run_from(found.options), **given), found.folder


def prune(runs: Path, most: float, chosen: Path) -> list[Path]:
    """Delete the oldest runs until the rest takes at most so many bytes.

    The last one, that which was chosen to go on, those that still go on, and folders that are not
    of this form stay.

    Returns:
        The deleted folders.
    """
    known = [folder for folder in in_order(_folders(runs)) if look_into(folder) is not None]
    sizes = {folder: _size(folder) for folder in known}
    total, deleted = sum(sizes.values()), []
    for folder in known[:-1]:
        if total <= most:
            break
        found = look_into(folder)
        if found is None or found.running or folder.resolve() == chosen.resolve():
            continue
        shutil.rmtree(folder, ignore_errors=True)
        deleted.append(folder)
        total -= sizes[folder]
    return deleted


def _folders(runs: Path) -> list[Path]:
    try:
        return [each for each in runs.iterdir() if each.is_dir() and not each.is_symlink()]
    except OSError:
        return []


def _size(folder: Path) -> int:
    total = 0
    for place, _, names in os.walk(folder):
        for name in names:
            with contextlib.suppress(OSError):
                total += os.lstat(os.path.join(place, name)).st_blocks * 512
    return total
