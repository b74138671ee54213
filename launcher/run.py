"""What one run of the robot is asked for."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from launcher import run_folder
from launcher.options import DEFAULT_KEEP, DEFAULT_MEMORY
from surveillance_runtime import node_table
from surveillance_runtime.discovery import LAST_DOMAIN
from surveillance_runtime.files import FileError
from surveillance_runtime.place import read_place_file

NOT_RECORDED = 'off'
RECORDER, MARKERS, PAGE = 'mission_recorder', 'mission_markers', 'mission_page'
_NAMESPACE = re.compile(r'/?[A-Za-z]\w*(/[A-Za-z]\w*)*\Z', re.ASCII)


@dataclass(frozen=True)
class Run:
    """What the command line asks for.

    Attributes:
        mode: one of `node_table.MODES`, or None for the default one.
        behaviour: one of `node_table.BEHAVIOURS`.
        place: file that describes the place, None for the behaviour's own.
        parameters: further parameter file, None for none.
        assignments: `[NODE:]NAME:=VALUE` of `-p`, which win over every file.
        composed: all nodes in one process.
        only, without: names of nodes, see `node_table.select`.
        log_level: one of `node_table.LOG_LEVELS`, None for ROS's own choice.
        namespace: of all nodes, None for none.
        domain: ROS domain, None for the environment's.
        seconds: how long to run, None until stopped.
        record: `off`, or the folder for the run's own, None for the usual one.
        keep: most of the recordings to keep, gigabytes.
        web, web_control: show the mission in browsers; let them act.
        web_address: where, as HOST:PORT, None for the page's own choice.
        memory: megabytes that a node may hold before it is started again; 0: any.
        alarm: a command that is run, with one line as its argument, when somebody is needed.
        fresh: do not go on with a run that had not come to its end.
        network: whether nodes of other machines are heard.
    """

    mode: str | None = None
    behaviour: str = node_table.DEFAULT_BEHAVIOUR
    place: Path | None = None
    parameters: Path | None = None
    assignments: Sequence[str] = ()
    composed: bool = False
    only: Sequence[str] = ()
    without: Sequence[str] = ()
    log_level: str | None = None
    namespace: str | None = None
    domain: int | None = None
    seconds: float | None = None
    record: str | None = NOT_RECORDED
    keep: float = DEFAULT_KEEP
    web: bool = False
    web_control: bool = False
    web_address: str | None = None
    memory: int = DEFAULT_MEMORY
    alarm: str = ''
    network: bool = False
    fresh: bool = False

    def check(self) -> None:
        """Look at everything that can be wrong before a process is started.

        Raises:
            ValueError: a value cannot be used.
        """
        if self.namespace is not None and not _NAMESPACE.match(self.namespace):
            raise ValueError(
                f'--namespace {self.namespace!r}: expected letters, digits and _ like robot1'
            )
        if self.domain is not None and not 0 <= self.domain <= LAST_DOMAIN:
            raise ValueError(f'--domain {self.domain}: expected a number from 0 to {LAST_DOMAIN}')
        if self.place is not None:
            try:
                read_place_file(self.place)
            except FileError as error:
                raise ValueError(f'--map {error}') from None
        if self.web_address is not None:
            page_address(self.web_address)
        try:
            alarm = shlex.split(self.alarm)
        except ValueError as error:
            raise ValueError(f'--alarm {self.alarm!r}: {error}') from None
        if alarm and shutil.which(alarm[0]) is None:
            raise ValueError(f'--alarm {self.alarm!r}: {alarm[0]!r} cannot be run')

    def nodes(self) -> tuple[node_table.Node, ...]:
        chosen = node_table.select(
            self.mode or node_table.DEFAULT_MODE, self.behaviour, self.only, self.without
        )
        asks = self.mode == 'MANUAL' and any(node.has_modes for node in chosen)
        # First, so that it is there for what is typed at once.
        return (node_table.find(node_table.CONSOLE), *chosen) if asks else chosen

    def observers(self) -> tuple[node_table.Node, ...]:
        """Return the nodes that only look on; they start last. `only` starts no other ones."""
        names = []
        if self.record != NOT_RECORDED and not self.only:
            names += [RECORDER, MARKERS]
        if self.has_page:
            names.append(PAGE)
        return tuple(node_table.find(name) for name in names)

    @property
    def has_page(self) -> bool:
        """Whether the mission is shown in browsers; an address alone asks for that, too."""
        return self.web or self.web_control or self.web_address is not None


def page_address(text: str) -> tuple[str, int]:
    """Return host and port of the page's address.

    Raises:
        ValueError: It is not of the form HOST:PORT.
    """
    try:
        found = urlsplit(f'//{text}')
        port = found.port
    except ValueError:  # of the port, or of brackets that are not closed
        port = None
    if port is None or found.netloc != text or found.username is not None:
        raise ValueError(f'--web-address {text!r}: expected HOST:PORT like 0.0.0.0:8080')
    return found.hostname or '127.0.0.1', port


def options_of(run: Run) -> dict[str, Any]:
    """Return what a run is asked for, as JSON holds it."""
    options: dict[str, Any] = json.loads(json.dumps(vars(run), default=str))
    return options


def run_from(options: Mapping[str, Any]) -> Run:
    """Return the run of options that `options_of` gave.

    Raises:
        ValueError: They are not of a run.
    """
    known = {field.name for field in fields(Run)}
    try:
        values = {name: options[name] for name in options if name in known}
        for name in ('place', 'parameters'):
            values[name] = Path(values[name]) if values.get(name) else None
        return Run(**values)
    except TypeError as error:
        raise ValueError(f'--resume: {error}') from None


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
    found = run_folder.find(runs, name)
    given = {name: value for name, value in vars(run).items() if value != getattr(usual, name)}
    return replace(run_from(found.options), **given), found.folder
