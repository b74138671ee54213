"""How sure it is that a door of a map parts two rooms, and that these are rooms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from floor_plans.map_rooms.joining import SEPARATE

DOUBTFUL = 0.75
"""What is less sure is to be looked at by a person first."""


def confidence(
    areas: Mapping[str, float], doors: Mapping[str, tuple[Sequence[str], float]]
) -> dict[str, float]:
    """Return how sure each room and door is, from 0.5 to 1.

    A door is sure if it is narrow for the smaller room behind it, as rooms are told apart
    (`joining`); a room is as sure as the least sure of its doors for which it is the smaller.

    Args:
        areas: Of the rooms, square metres.
        doors: The rooms that each door joins, and its width, metres.
    """
    found = dict.fromkeys(areas, 1.0)
    for door, (rooms, width) in doors.items():
        smaller = min(rooms, key=lambda room: areas.get(room, 0.0))
        separation = max(areas.get(smaller, 0.0) / max(width, 0.05) ** 2, SEPARATE)
        found[door] = round(1.0 - 0.5 * SEPARATE / separation, 2)
        found[smaller] = min(found.get(smaller, 1.0), found[door])
    return found
