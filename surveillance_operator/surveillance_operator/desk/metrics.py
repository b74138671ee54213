"""Figures of a mission as Prometheus reads them: its text format, which needs no package.

https://prometheus.io/docs/instrumenting/exposition_formats/#text-based-format
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from surveillance_operator.desk.event_index import DeskEvent
from surveillance_operator.desk.handling import AlarmState
from surveillance_operator.mission_state import MissionState

KIND = 'text/plain; version=0.0.4; charset=utf-8'
Row = tuple[Mapping[str, str], float]


def metrics(
    states: Mapping[str, MissionState],
    open_events: Iterable[DeskEvent],
    now: float,
    viewers: int,
) -> str:
    """Return the figures.

    Args:
        states: What is known of each robot, by its name; one that is alone has none.
        open_events: The alarms and warnings that are open.
        now: Seconds since 1970.
        viewers: How many look at the page.
    """
    robots = {name: state for name, state in states.items() if name or len(states) == 1}
    lines: list[str] = []

    def add(name: str, help_: str, rows: Iterable[Row]) -> None:
        found = list(rows)
        if not found:
            return
        lines.extend((f'# HELP {name} {help_}', f'# TYPE {name} gauge'))
        lines.extend(f'{name}{_labels(labels)} {value:.10g}' for labels, value in found)

    def of_each(value: Any) -> Iterable[Row]:
        for name, state in robots.items():
            if (number := value(state)) is not None:
                yield {'robot': name}, float(number)

    add('patrol_battery_percent', 'Charge of the battery.', of_each(lambda s: s.task.battery))
    add('patrol_stopped', 'Whether a person has stopped it.', of_each(lambda s: s.task.stopped))
    add('patrol_nodes_up', 'Nodes that run.', of_each(lambda s: len(s.health.nodes)))
    add(
        'patrol_decisions_total',
        'Decisions that the page has heard of.',
        of_each(lambda s: s.task.decision_number),
    )
    add(
        'patrol_seconds_since_visit',
        'Seconds since the last visit of each place, on the clock of the mission.',
        (
            ({'robot': name, 'place': place}, max(0.0, state.now - at))
            for name, state in robots.items()
            for place, at in sorted(state.place.visited_at.items())
            if at
        ),
    )
    add(
        'patrol_door_open',
        'Whether a door is open, as far as is known.',
        (
            ({'robot': name, 'door': door}, float(is_open))
            for name, state in robots.items()
            for door, is_open in sorted((state.place.doors or {}).items())
            if is_open is not None
        ),
    )
    counts = Counter((each.state(now), each.is_alarm) for each in open_events)
    add(
        'patrol_alarms',
        'Alarms that are open, by their state.',
        (
            ({'state': state}, float(counts[str(state), True]))
            for state in AlarmState
            if state is not AlarmState.OVER
        ),
    )
    warnings = sum(count for (_, is_alarm), count in counts.items() if not is_alarm)
    add('patrol_warnings', 'Warnings that go on.', [({}, float(warnings))])
    add('patrol_page_viewers', 'Who look at the page.', [({}, float(viewers))])
    return '\n'.join(lines) + '\n'


def _labels(labels: Mapping[str, str]) -> str:
    told = ','.join(f'{key}="{_escaped(value)}"' for key, value in labels.items() if value)
    return f'{{{told}}}' if told else ''


def _escaped(value: str) -> str:
    return value.replace('\\', r'\\').replace('"', r'\"').replace('\n', r'\n')
