"""The robots of a fleet, a line for each: for the terminal view, the console and `fleet`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from surveillance_operator.figures import figures_line
from surveillance_operator.mission_state import MissionState
from surveillance_operator.mission_words import doing, shares, troubles

SHARED = 'shared'
"""Stands for the programs that all robots share, where something is wrong with them."""


def fleet_lines(states: Mapping[str, MissionState]) -> list[str]:
    """Return what each robot does, and below it what a person should look at.

    Args:
        states: By the robot's name; what the robots share has none.
    """
    width = max(map(len, [*states, SHARED]))
    return [line for name, each in states.items() for line in _lines(name, each, width)]


def _lines(name: str, state: MissionState, width: int) -> Iterator[str]:
    if name:
        place = state.robot_place
        figures = figures_line(state, brief=True) or '–'
        told = filter(None, (doing(state), shares(state)))
        yield f'{name:<{width}}  {place or "–":<8}  {figures:<18}  {"; ".join(told)}'
    for trouble in troubles(state):
        yield f'{name or SHARED:<{width}}  ! {trouble}'
