"""The robots of a fleet, a line for each: for the terminal view, the console and `fleet`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from surveillance_operator.mission_state import MissionState, doing, shares, troubles

SHARED = 'shared'
"""Stands for the programs that all robots share, where something is wrong with them."""


def fleet_lines(snapshots: Mapping[str, MissionState]) -> list[str]:
    """Return what each robot does, and below it what a person should look at.

    Args:
        snapshots: By the robot's name; what the robots share has none.
    """
    width = max(map(len, [*snapshots, SHARED]))
    return [line for name, each in snapshots.items() for line in _lines(name, each, width)]


def _lines(name: str, snapshot: MissionState, width: int) -> Iterator[str]:
    if name:
        place = snapshot.status.place if snapshot.status else ''
        battery = '–' if snapshot.battery is None else f'{snapshot.battery:.0f} %'
        told = filter(None, (doing(snapshot), shares(snapshot)))
        yield f'{name:<{width}}  {place or "–":<8}  {battery:>5}  {"; ".join(told)}'
    for trouble in troubles(snapshot):
        yield f'{name or SHARED:<{width}}  ! {trouble}'
