"""The figures of a mission: one table, from which every view shows them.

A figure is a short value with a label, such as the battery's charge. An entry of `FIGURES` is all
that a new one takes. The terminal view, the page's head, the console's `status`, a fleet's lines
and the recording's time line, and so a replay, show each entry; a topic that brings it is
subscribed to by each of them, and read from recordings of other programs.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from surveillance_operator.mission_state import MissionState
from surveillance_runtime.incidents import Severity

LONGEST = 80
"""Characters of a sentence that is a figure."""


class FigureTopic(NamedTuple):
    """A topic that nothing but one figure is read from.

    Attributes:
        topic: Its name, relative to the robot's namespace; in no line of `topics.TOPICS`.
        kind: The type of its messages, as `sensor_msgs/msg/BatteryState`.
        value: Returns what a message says, None for nothing; raises `ValueError` for one that
            cannot be used. It becomes `MissionState.measured` by the figure's name.
    """

    topic: str
    kind: str
    value: Callable[[Any], Any]


class Figure(NamedTuple):
    """One figure.

    Attributes:
        name: Of its element on the page, and in time lines; each once.
        label: What stands before it.
        words: Returns what is shown; empty while it is not known.
        is_bad: Tells whether a person should look at it.
        fraction: Returns how full it is, 0 to 1, where it is to be drawn as a bar; None: no bar.
        awaited: The topic that is named while the figure is not known, and who publishes it; None:
            nothing is shown.
        is_brief: Whether it is shown where there is one line for a robot.
        heard: Where it comes from, unless it follows from fields that the state has already.
    """

    name: str
    label: str
    words: Callable[[MissionState], str]
    is_bad: Callable[[MissionState], bool] = lambda _state: False
    fraction: Callable[[MissionState], float | None] = lambda _state: None
    awaited: tuple[str, str] | None = None
    is_brief: bool = False
    heard: FigureTopic | None = None


class ShownFigure(NamedTuple):
    """A figure as it is at one moment; what its functions return, as `Figure` says."""

    figure: Figure
    words: str
    is_bad: bool
    fraction: float | None


def figures_of(state: MissionState) -> Iterator[ShownFigure]:
    """Yield every figure as it is now, in the order of the table."""
    for each in FIGURES:
        yield ShownFigure(each, each.words(state), each.is_bad(state), each.fraction(state))


def figures_line(state: MissionState, *, brief: bool = False) -> str:
    """Return the figures that are known in one line.

    Args:
        state: What is known of the mission.
        brief: Only those that are shown where there is one line for a robot.
    """
    known = (
        each for each in figures_of(state) if each.words and (each.figure.is_brief or not brief)
    )
    return ' · '.join(f'{each.figure.label} {each.words}' for each in known)


def _battery(state: MissionState) -> str:
    level, low = state.task.battery, state.task.battery_low
    return '' if level is None else f'{level:.0f} %{" (low)" if low else ""}'


def _doors(state: MissionState) -> str:
    doors = state.place.doors or {}
    closed = [door for door, is_open in doors.items() if not is_open]
    if not doors:
        return ''
    if not closed:
        return f'all {len(doors)} open'
    return f'{" ".join(closed)} closed, {len(doors) - len(closed)} open'


def _incidents(state: MissionState) -> str:
    """Return how many incidents go on, and the worst of them in words."""
    found = state.health.incidents.values()
    if not found:
        return ''
    worst = next((each for each in found if each.severity is Severity.ALARM), next(iter(found)))
    others = f', and {len(found) - 1} more' if len(found) > 1 else ''
    by = f' ({worst.acknowledged_by} takes care)' if worst.acknowledged_by else ''
    return f'{textwrap.shorten(worst.text, LONGEST, placeholder=" ...")}{by}{others}'


def _calls_somebody(state: MissionState) -> bool:
    return any(
        each.severity is Severity.ALARM and not each.acknowledged_by
        for each in state.health.incidents.values()
    )


def _volts(message: Any) -> float | None:
    return float(message.voltage) if math.isfinite(message.voltage) else None


FIGURES: tuple[Figure, ...] = (
    Figure(
        'battery',
        'battery',
        _battery,
        lambda state: state.task.battery_low,
        lambda state: None if state.task.battery is None else state.task.battery / 100,
        awaited=('battery_level', 'battery_controller publishes it'),
        is_brief=True,
    ),
    Figure(
        'voltage',
        'voltage',
        lambda state: f'{state.measured["voltage"]:.1f} V' if 'voltage' in state.measured else '',
        heard=FigureTopic('battery_state', 'sensor_msgs/msg/BatteryState', _volts),
    ),
    Figure(
        'doors',
        'doors',
        _doors,
        lambda state: not all((state.place.doors or {}).values()),
        awaited=('door_states', 'the simulator or the doors publish it'),
    ),
    Figure('incidents', 'incidents', _incidents, _calls_somebody),
)
"""Every figure, in the order in which they are shown."""
