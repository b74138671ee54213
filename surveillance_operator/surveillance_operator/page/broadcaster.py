"""Passes states on to any number of viewers, each as fast as it reads and no faster.

Of each part only the newest value is kept, as text that is made once for all viewers. A viewer that
comes gets everything; later what changed since it was served last. Nothing is queued.

A viewer looks at one robot: it gets all parts of that one, and of each other robot of the fleet
those of `GLANCE`. A robot that is alone has no name; in a fleet, that is what all robots share.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator
from typing import Any

from surveillance_operator.mission_state import MissionState
from surveillance_operator.page_state import (
    GLANCE,
    PARTS,
    Parts,
    PatchMaker,
    lengthen,
    merged_events,
)

LEAST_PERIOD = 0.015
"""Seconds between two messages to one viewer."""
PER_VIEWER = 0.002
"""The same for each viewer that there is, seconds: many are told more seldom."""
HEARTBEAT = 2.0
"""Seconds after which a viewer is told the time at least."""
OF_ALL = frozenset({'events', 'replay', 'desk'})
"""Parts that are not of one robot."""

Texts = dict[str, tuple[int, str]]
"""By the name of a part: the version that it came with, and the part as JSON."""


class _Robot:
    """What viewers are shown of one robot."""

    def __init__(self) -> None:
        self.patches = PatchMaker()
        self.state: MissionState | None = None
        self.now = 0.0
        self.texts: Texts = {}
        self.trail: list[list[float]] = []
        self.events: list[Any] = []


class Broadcaster:
    """The newest parts, for all viewers."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: dict[asyncio.Event, str] = {}
        self._robots: dict[str, _Robot] = {}
        self._of_all: Texts = {}
        self._version = 0
        self._messages: dict[tuple[str, int, int, float], str] = {}
        self.closed = False

    @property
    def viewers(self) -> int:
        """How many there are."""
        return len(self._waiting)

    def show(self, state: MissionState, robot: str = '') -> None:
        """Take a new state of a robot; from any thread."""
        with self._lock:
            shown = self._robots.setdefault(robot, _Robot())
            shown.state, shown.now = state, state.now
            if not self._waiting:
                return  # Nobody looks: what is new is computed when somebody does.
            self._bring(robot)
        self._rouse()

    def show_parts(self, parts: Parts, now: float | None, *, whole: bool, robot: str = '') -> None:
        """Take parts that are known already, as a replay does; from any thread.

        Args:
            parts: What changed, or everything.
            now: The mission's time; None for no other than before.
            whole: Whether it is everything: what is not in it is not known.
            robot: Whose they are.
        """
        with self._lock:
            shown = self._robots.setdefault(robot, _Robot())
            shown.now = shown.now if now is None else now
            everything = {**dict.fromkeys(PARTS), 'trail': [], **parts}
            self._accept(robot, everything if whole else parts)
        self._rouse()

    def show_desk(self, part: Any) -> None:
        """Take what is open on the desk, which is of all robots; from any thread."""
        with self._lock:
            self._version += 1
            self._of_all['desk'] = self._version, _text(part)
        self._rouse()

    def forget(self, robot: str) -> None:
        """Show a robot no longer; from any thread."""
        with self._lock:
            if self._robots.pop(robot, None) is not None:
                self._version += 1
                self._merge()
        self._rouse()

    def close(self) -> None:
        """End all streams; from any thread."""
        self.closed = True
        self._rouse()

    async def stream(self, robot: str | None = None) -> AsyncIterator[str]:
        """Yield what a new viewer is to see, as server-sent events.

        Args:
            robot: The one that it looks at; None, or where there is none of that name: the first.
        """
        self._loop = asyncio.get_running_loop()
        changed = asyncio.Event()
        with self._lock:
            self._waiting[changed] = self._chosen(robot)
            for name in self._robots:
                self._bring(name, anew=True)
        try:
            seen, chosen, names = -1, '', set[str]()
            yield 'retry: 1000\n\n'
            while not self.closed:
                changed.clear()
                with self._lock:
                    now_chosen, now_names = self._chosen(robot), set(self._robots)
                    # Another robot, or one fewer: what is not told again is not known.
                    if now_chosen != chosen or names - now_names:
                        seen = -1
                    chosen, names = now_chosen, now_names
                    if seen < 0:
                        self._waiting[changed] = chosen
                        self._bring(chosen, anew=True)
                    message = self._shared_message(chosen, seen)
                    seen = self._version
                yield f'data: {message}\n\n'
                await asyncio.sleep(max(LEAST_PERIOD, PER_VIEWER * len(self._waiting)))
                try:
                    await asyncio.wait_for(changed.wait(), HEARTBEAT)
                except TimeoutError:
                    continue
        finally:
            with self._lock:
                self._waiting.pop(changed, None)

    def _chosen(self, asked: str | None) -> str:
        """Return the robot that a viewer sees; what all share only when it is asked for."""
        if asked is not None and asked in self._robots:
            return asked
        return min(self._robots, key=lambda name: (not name, name), default='')

    def _shared_message(self, chosen: str, seen: int) -> str:
        """Return the message, which is made once for all viewers that know the same."""
        now = self._robots[chosen].now if chosen in self._robots else 0.0
        key = chosen, seen, self._version, now
        if key not in self._messages:
            self._messages = {
                each: text
                for each, text in self._messages.items()
                if each[2] == self._version and each[3] == now
            }
            self._messages[key] = self._message(chosen, seen)
        return self._messages[key]

    def _message(self, chosen: str, seen: int) -> str:
        """Return what a viewer is told that knows the versions up to one."""
        robot = self._robots.get(chosen, _Robot())
        parts = {name: text for name, (at, text) in robot.texts.items() if at > seen}
        if seen < 0:
            parts['trail'] = json.dumps(robot.trail)
        parts |= {name: text for name, (at, text) in self._of_all.items() if at > seen}
        others = {
            name: glance
            for name, other in sorted(self._robots.items())
            if name != chosen
            and (
                glance := {
                    part: text
                    for part, (at, text) in other.texts.items()
                    if at > seen and part in GLANCE
                }
            )
        }
        body = ','.join(f'{json.dumps(name)}:{_object(each)}' for name, each in others.items())
        return (
            f'{{"now":{robot.now:.2f},"whole":{int(seen < 0)},"robot":{json.dumps(chosen)},'
            f'"p":{_object(parts)},"r":{{{body}}}}}'
        )

    def _bring(self, name: str, *, anew: bool = False) -> None:
        """Compute what viewers see of a robot's state; its whole trail, too, if anew."""
        robot = self._robots.get(name)
        if robot is None or robot.state is None:
            return
        watched = name in self._waiting.values()
        patch = robot.patches.patch(robot.state, None if watched else GLANCE)
        self._accept(name, patch)
        if anew:
            robot.trail = robot.patches.whole()['trail']

    def _accept(self, name: str, parts: Parts) -> None:
        robot = self._robots[name]
        # Viewers lengthen the trail themselves, unless they are given one.
        if 'trail' in parts:
            robot.trail = list(parts['trail'])
        elif parts.get('pose'):
            lengthen(robot.trail, parts['pose'])
        if not parts:
            return
        self._version += 1
        for part, value in parts.items():
            if part == 'events':
                robot.events = list(value or ())
                self._merge()
                continue
            texts = self._of_all if part in OF_ALL else robot.texts
            texts[part] = self._version, _text(value)

    def _merge(self) -> None:
        """Tell the events of all robots."""
        told = {name: robot.events for name, robot in self._robots.items()}
        self._of_all['events'] = self._version, _text(merged_events(told))

    def _rouse(self) -> None:
        loop = self._loop
        if loop is None or loop.is_closed():
            return
        with self._lock:
            waiting = list(self._waiting)
        for each in waiting:
            loop.call_soon_threadsafe(each.set)


def _text(value: Any) -> str:
    return json.dumps(value, separators=(',', ':'), allow_nan=False)


def _object(parts: dict[str, str]) -> str:
    return '{' + ','.join(f'"{name}":{text}' for name, text in parts.items()) + '}'
