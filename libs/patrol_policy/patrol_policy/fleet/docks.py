"""When each robot of a fleet charges: slots at the docks that do not overlap.

Each robot names the latest time at which it must be at a dock, and how long it then charges. The
slots are laid backwards from the latest of these times, each as late as it can be, so that robots
that would come together come one after another and nobody waits at a dock. It is a pure function:
each robot computes the same slots from the same facts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class ChargeNeed:
    """What a robot needs of a dock.

    Attributes:
        robot: Its name.
        latest: When it must be at a dock at the latest, seconds since 1970.
        seconds: How long it charges.
        dock: The dock it charges at already; it has it until now + seconds.
    """

    robot: str
    latest: float
    seconds: float
    dock: str | None = None


@dataclass(frozen=True)
class DockSlot:
    """A time at a dock.

    Attributes:
        robot: Whose it is.
        dock: Which dock.
        begin: Seconds since 1970.
        end: Seconds since 1970.
        late: Seconds after the latest time at which the robot must be there: the docks are too few.
    """

    robot: str
    dock: str
    begin: float
    end: float
    late: float = 0.0


def dock_slots(
    needs: Sequence[ChargeNeed], docks: Sequence[str], now: float
) -> dict[str, DockSlot]:
    """Return the slot of each robot, by its name.

    Raises:
        ValueError: There are robots and no dock, or a robot charges at an unknown dock.
    """
    if needs and not docks:
        raise ValueError('robots need to charge, and there is no dock')
    slots: dict[str, DockSlot] = {}
    free_from = dict.fromkeys(docks, now)
    for need in needs:
        if need.dock is None:
            continue
        if need.dock not in free_from:
            raise ValueError(f'{need.robot} charges at {need.dock}, expected {", ".join(docks)}')
        slots[need.robot] = DockSlot(need.robot, need.dock, now, now + need.seconds)
        free_from[need.dock] = max(free_from[need.dock], now + need.seconds)
    waiting = sorted(
        (need for need in needs if need.dock is None),
        key=lambda need: (need.latest, need.robot),
        reverse=True,
    )
    free_until = dict.fromkeys(docks, math.inf)
    wishes: list[tuple[float, ChargeNeed]] = []
    for need in waiting:
        dock = max(docks, key=lambda name: (free_until[name], -docks.index(name)))
        begin = min(need.latest, free_until[dock] - need.seconds)
        free_until[dock] = begin
        wishes.append((begin, need))
    # Forwards again: whoever is first gets the dock that is free first.
    for wished, need in reversed(wishes):
        dock = min(docks, key=lambda name: (free_from[name], docks.index(name)))
        begin = max(wished, free_from[dock])
        free_from[dock] = begin + need.seconds
        late = max(0.0, begin - need.latest)
        slots[need.robot] = DockSlot(need.robot, dock, begin, free_from[dock], late)
    return slots
