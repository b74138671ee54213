"""The desk of a run that goes on: follows its logs, tells what is open, reads older runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from surveillance_operator.desk.event_index import (
    DeskEvent,
    EventIndex,
    LogFollower,
    folders_of,
    read_run,
)
from surveillance_operator.desk.questions import EventQuestions, Question

LOOK_PERIOD = 0.15
"""Seconds between two looks at the logs: a look that finds nothing costs two calls."""
FOLDERS_PERIOD = 5.0
"""Seconds between two looks for robots that have a log since."""
MOST_OPEN = 100
"""So many open alarms are told; there are more than a person can look at."""
OLD_RUNS = 2000
"""So many older runs are read, the newest first."""


class LiveDesk:
    """Follows the logs of a run on threads of its own.

    Args:
        folder: Of the run.
        show: Takes what is open as a part of the page, each time that it changes.
        wall: Returns the seconds since 1970.
    """

    def __init__(
        self,
        folder: Path,
        show: Callable[[Mapping[str, Any]], object],
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.folder, self._show, self._wall = folder, show, wall
        self.index = EventIndex()
        self._followers: dict[str, LogFollower] = {}
        self._told: Any = None
        self._look_for_folders_at = 0.0

    def questions(self) -> dict[str, Question]:
        """Return what the page may ask, by name."""
        return EventQuestions(self.index, self._wall).all()

    def find(self, key: str) -> DeskEvent:
        """Return an event.

        Raises:
            ValueError: There is none of that key.
        """
        found = self.index.find(key)
        if found is None:
            raise ValueError(f'no event {key[:80]!r}')
        return found

    def follow(self, wait: Callable[[float], bool]) -> None:
        """Follow the logs until the end.

        Args:
            wait: Waits for so many seconds; returns whether this is the end.
        """
        while not wait(LOOK_PERIOD):
            self.look()

    def read_older(self, is_over: Callable[[], bool]) -> None:
        """Read the runs beside this one, the newest first.

        Args:
            is_over: Returns whether this is the end.
        """
        try:
            runs = [each for each in self.folder.parent.iterdir() if each.is_dir()]
        except OSError:
            return
        for run in sorted(runs, key=lambda each: each.name, reverse=True)[:OLD_RUNS]:
            if is_over():
                return
            if run.name != self.folder.name:
                read_run(self.index, run)

    def look(self) -> None:
        """Take what is new in the logs, and tell what is open if that has changed."""
        now = time.monotonic()
        if now >= self._look_for_folders_at:
            self._look_for_folders_at = now + FOLDERS_PERIOD
            for robot, folder in folders_of(self.folder):
                if robot not in self._followers:
                    self._followers[robot] = self._follower(robot, folder)
        for each in self._followers.values():
            each.look()
        part = self.part()
        told = {key: value for key, value in part.items() if key != 'at'}
        if told != self._told:
            self._told = told
            self._show(part)

    def part(self) -> dict[str, Any]:
        """Return what is open as a part of the page."""
        now = self._wall()
        found = self.index.open_at(now)
        return {
            'at': round(now, 2),
            'count': len(found),
            'open': [each.to_json(now, self.index.mutes) for each in found[:MOST_OPEN]],
            'mutes': self.index.mutes.listed(),
        }

    def _follower(self, robot: str, folder: Path) -> LogFollower:
        def take(lines: Any) -> None:
            self.index.read(lines, self.folder.name, robot, live=True)

        return LogFollower(folder, take)
