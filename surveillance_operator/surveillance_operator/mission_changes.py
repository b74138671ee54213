"""What changed between two moments of a mission: in words, and as its history of the last hour."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol_policy.situation import Decision
from surveillance_operator.mission_state import (
    MachineTransition,
    MissionHistory,
    MissionState,
    Notice,
    PlaceView,
    TaskView,
)
from surveillance_operator.mission_words import STOPPED, WAITS_FOR_HELP, decision_line

BATTERY_STEP = 10
"""Percent between two lines about the battery."""
KEPT_NOTICES = 50
HISTORY_SECONDS = 3600.0
MOST_HISTORY = 5000
"""How far back histories go, seconds of the mission's time, and their most entries."""


def follow(old: MissionState, new: MissionState, at: float) -> tuple[MissionState, list[Notice]]:
    """Return `new` with its events, restarts and history, and what changed since `old`.

    Args:
        old, new: Two moments.
        at: The later one, seconds since 1970.
    """
    told = list(changes(old, new))
    notices = [replace(each, at=at) for each in told if not each.routine]
    more: dict[str, Any] = {}
    if notices:
        more['notices'] = (*new.notices, *notices)[-KEPT_NOTICES:]
    if new.health.nodes is not old.health.nodes and (again := restarted(old, new)):
        restarts = new.health.restarts
        more['restarts'] = {**restarts, **{node: restarts.get(node, 0) + 1 for node in again}}
    history = _history(old, new)
    if history != new.history:
        more['history'] = history
    return (new.having(**more) if more else new), told


def restarted(old: MissionState, new: MissionState) -> list[str]:
    """Return the nodes that came back, or of which a new process is there."""
    back = old.health.ended & new.health.nodes.keys()
    renewed = {
        node
        for node in old.health.nodes.keys() & new.health.nodes.keys()
        if old.health.nodes[node] and new.health.nodes[node] - old.health.nodes[node]
    }
    return sorted(back | renewed)


def changes(old: MissionState, new: MissionState) -> Iterator[Notice]:
    """Yield what is new in a state, one line each, as a log would tell it."""
    yield from _status_changes(old, new)
    yield from _decision_changes(old, new)
    yield from _battery_changes(old.task, new.task)
    yield from _place_changes(old.place, new.place)
    yield from _obstacle_changes(old.sensors.obstacles, new.sensors.obstacles)
    if old.task.stopped != new.task.stopped:
        yield Notice(STOPPED if new.task.stopped else 'the robot is released')
    if (paused := new.machine.paused) != old.machine.paused:
        yield Notice(f'the state machine {"is paused" if paused else "continues"}')
    if new.task.is_out != old.task.is_out:
        yield Notice(f'{"taken out of" if new.task.is_out else "put back into"} the patrol')
    for each in new.machine.waiting:
        if each not in old.machine.waiting:
            yield Notice(f'approval is waited for: {each}')
    yield from _node_changes(old, new)


def _decision_changes(old: MissionState, new: MissionState) -> Iterator[Notice]:
    before, decision = old.task.decision, new.task.decision
    is_same = (decision, new.task.decision_number) == (before, old.task.decision_number)
    if decision is not None and not is_same:
        again = before is not None and _waits(decision) and _waits(before)
        yield Notice(decision_line(new), detail=decision.reason, routine=again)


def _battery_changes(old: TaskView, new: TaskView) -> Iterator[Notice]:
    if new.battery is not None:
        before = None if old.battery is None else math.ceil(old.battery / BATTERY_STEP)
        if before != math.ceil(new.battery / BATTERY_STEP):
            yield Notice(f'battery at {new.battery:.0f} %', routine=True)
    if new.battery_low != old.battery_low:
        yield Notice('battery low' if new.battery_low else 'battery no longer low')


def _place_changes(old: PlaceView, new: PlaceView) -> Iterator[Notice]:
    if new.grid is not None and new.grid is not old.grid:
        rows, columns = new.grid.cells.shape
        cells = f'{columns} x {rows} cells of {new.grid.resolution:g} m'
        yield Notice(f'a map of {cells}', routine=True, shared=True)
    before = old.doors or {}
    for door, is_open in (new.doors or {}).items():
        if is_open != before.get(door, True):
            yield Notice(f'door {door} {"opened" if is_open else "closed"}', shared=True)
    for place in sorted(new.urgent - old.urgent):
        yield Notice(f'{place} is URGENT', shared=True)


def _obstacle_changes(
    old: NDArray[np.float64] | None, new: NDArray[np.float64] | None
) -> Iterator[Notice]:
    if new is None or new is old:
        return
    had = old is not None and len(old) > 0
    if len(new) and not had:
        x, y = new[0]
        yield Notice(f'something stands at ({x:.1f}, {y:.1f})')
    elif had and not len(new):
        yield Notice('nothing stands about any more')


def _waits(decision: Decision) -> bool:
    """Tell whether the robot stays where it is until another one has made way."""
    return decision.place == decision.from_place


def _node_changes(old: MissionState, new: MissionState) -> Iterator[Notice]:
    if old.health.nodes is new.health.nodes and old.health.ended is new.health.ended:
        return
    if old.health.nodes and not new.health.nodes:
        yield Notice('every node has ended: waiting for the next mission')
    elif gone := sorted(new.health.ended - old.health.ended):
        yield Notice(f'{", ".join(gone)} ended')
    if back := sorted(old.health.ended & new.health.nodes.keys()):
        yield Notice(f'{", ".join(back)} came back')
    for node in restarted(old, new):
        if node not in old.health.ended:
            yield Notice(f'{node} was started again')


def _status_changes(old: MissionState, new: MissionState) -> Iterator[Notice]:
    status, before = new.task.status, old.task.status
    if status is None:
        return
    known = before and (before.machine, before.state, old.whereabouts)
    if known != (status.machine, status.state, new.whereabouts):
        state = status.state or 'not started'
        yield Notice(f'{status.machine} {state}: {new.whereabouts}', routine=True)
    if status.text and (before is None or status.text != before.text):
        yield Notice(f'{WAITS_FOR_HELP}: {status.text}' if status.waiting_for_help else status.text)


def _history(old: MissionState, new: MissionState) -> MissionHistory:
    history, level = new.history, new.task.battery
    visited, visited_before = new.place.visited_at, old.place.visited_at
    transitions, before = new.machine.transitions, old.machine.transitions
    if visited is visited_before and level == old.task.battery and transitions is before:
        return history
    visits = [
        (at, place)
        for place, at in visited.items()
        if at > max(0.0, visited_before.get(place, 0.0))
    ]
    battery = []
    if level is not None and (not history.battery or abs(history.battery[-1][1] - level) >= 1.0):
        battery.append((new.now, level))
    last = before[-1].sequence if before else 0
    # The sequence of a machine that was started again begins anew.
    if transitions and transitions[-1].sequence < last:
        last = 0
    marks = [mark for each in transitions if each.sequence > last for mark in _marks(each)]
    since = new.now - HISTORY_SECONDS

    def recent(entries: Iterable[Any]) -> tuple[Any, ...]:
        return tuple(each for each in entries if each[0] >= since)[-MOST_HISTORY:]

    return MissionHistory(
        recent((*history.visits, *sorted(visits))),
        recent((*history.battery, *battery)),
        recent((*history.marks, *marks)),
    )


def _marks(transition: MachineTransition) -> Iterator[tuple[float, str, str]]:
    """Yield the marks of a transition on the strips of time."""
    if re.search('RECHARG|CHARGING', transition.to_state):
        yield transition.time, 'recharge', transition.to_state
    elif 'HELP' in transition.to_state:
        yield transition.time, 'help', f'{transition.from_state} {transition.outcome}'
    elif transition.outcome == 'failed':
        yield transition.time, 'failure', f'{transition.from_state} failed'
    elif transition.from_state == 'RECOVER':
        yield transition.time, 'recovery', transition.outcome
