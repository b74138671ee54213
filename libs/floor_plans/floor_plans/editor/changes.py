"""What has changed between an older and a newer place of one building, each piece to be decided.

Both places call what is still there by the same names. A piece that is not wanted is undone by
changes of the editor: a new room is joined with the one that it was a part of, a new door is walled
off, a room that is gone is cut off again where its door was.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from floor_plans.floor_plan import FloorPlan
from floor_plans.room_map import RoomMap
from floor_plans.rooms import PATROL_TABLES

if TYPE_CHECKING:
    from floor_plans.imports.renewal import Alignment

Step = tuple[str, Mapping[str, Any]]
"""A change of the editor and its fields."""
_MOST_POINTS = 2000
"""So many points of a room say where it is on the other map."""


@dataclass(frozen=True)
class PlaceChange:
    """A room or a door that only one of two places has.

    Attributes:
        kind: `room` or `door`.
        name: Of it; rooms and doors share no name.
        is_new: Whether the newer place has it.
        said: What has changed, in words.
        keep: What brings the older state back; none: nothing can.
    """

    kind: str
    name: str
    is_new: bool
    said: str
    keep: tuple[Step, ...]

    def is_open(self, plan: FloorPlan) -> bool:
        """Tell whether a place is still as the newer one in this."""
        known = plan.place.rooms if self.kind == 'room' else plan.place.doors
        return (self.name in known) == self.is_new


def changes_between(
    older: FloorPlan, described: Mapping[str, Any], newer: FloorPlan, lies: Alignment
) -> tuple[PlaceChange, ...]:
    """Return what has changed, rooms first.

    Args:
        older: The place as it was.
        described: What its file says below `ros__parameters`.
        newer: The place as it is.
        lies: How the newer one lies on the older one.
    """
    old, new = RoomMap(older), RoomMap(newer)
    was, now = older.place, newer.place
    found: list[PlaceChange] = []
    for room in now.rooms:
        if room not in was.rooms:
            before = _mostly_in(new, room, lies.to_old, old)
            doors = set(now.rooms.get(before or '', ())) & set(now.rooms[room])
            steps: tuple[Step, ...] = (('join', {'first': before, 'second': room}),)
            said = f'room {room} is new' + (f': it was a part of {before}' if before else '')
            found.append(PlaceChange('room', room, True, said, steps if doors else ()))
    for room in was.rooms:
        if room not in now.rooms:
            there = _mostly_in(old, room, lies.to_new, new)
            steps = _cut_off(older, described, lies, room, there) if there else ()
            said = f'room {room} is gone: ' + (f'it is a part of {there}' if there else 'no floor')
            found.append(PlaceChange('room', room, False, said, steps))
    both = was.rooms.keys() & now.rooms.keys()
    for door, sides in now.doors.items():
        if door not in was.doors and len(sides) == 2 and set(sides) <= both:
            said = f'door {door} is new: it joins {sides[0]} and {sides[1]}'
            found.append(PlaceChange('door', door, True, said, (('wall_off', {'name': door}),)))
    for door, sides in was.doors.items():
        if door not in now.doors and len(sides) == 2 and set(sides) <= both:
            said = f'door {door} is gone: the newer map is closed between {sides[0]} and {sides[1]}'
            found.append(PlaceChange('door', door, False, said, ()))
    return tuple(found)


def _mostly_in(
    rooms: RoomMap, room: str, moved: Callable[[Any], Any], others: RoomMap
) -> str | None:
    """Return the room of another place in which most of a room lies; None: in none."""
    cells = np.argwhere(rooms.mask(room) & rooms.grid.free)
    points = rooms.grid.centres_of(cells[:: max(1, len(cells) // _MOST_POINTS)])
    counts = Counter(others.room_at(x, y) for x, y in moved(points).tolist())
    return counts.most_common(1)[0][0] if counts else None


def _cut_off(
    older: FloorPlan, described: Mapping[str, Any], lies: Alignment, room: str, there: str
) -> tuple[Step, ...]:
    """Return what cuts a room off another one again, with all that was said of it."""
    doors = [
        older.doors[name]
        for name in older.place.rooms[room]
        if name in older.doors and there in older.place.doors[name]
    ]
    if not doors:
        return ()
    (x1, y1), (x2, y2), (x, y) = lies.to_new(
        [*doors[0].ends, older.place.positions[room][:2]]
    ).tolist()
    line = {'x1': x1, 'y1': y1, 'x2': x2, 'y2': y2}
    steps: list[Step] = [('cut', {**line, 'name': room, 'door': doors[0].name, 'x': x, 'y': y})]
    for table in PATROL_TABLES:
        if room in (entries := dict(described.get(table) or {})):
            rule = {'room': room, 'key': table, 'value': entries[room]}
            steps.append(('set_rule', rule))
    for key, operation in (('keep_out', 'set_keep_out'), ('sweep', 'set_sweep')):
        if room in (described.get(key) or ()):
            steps.append((operation, {'room': room, 'on': True}))
    return tuple(steps)
