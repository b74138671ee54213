"""What moves often, as a chair does: learned from visits, so that it is told no more.

The metarooms of STRANDS (Ambrus, Bore, Folkesson and Jensfelt, "Meta-rooms: Building and
maintaining long term spatial models in a dynamic world", IROS 2014) part what stays from what
moves by looks over weeks. Here a thing is known by its place, its size and where it has stood: one
of like size that stands near one of these spots is taken for it, one at a time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from indoor_watch.floor import ROAMS, SAME_SIZE, Change, ObjectChange

ANOTHER_SPOT = 0.4
"""A thing has moved when it is so far from where it stood, metres: as two assessments mean one
thing up to there (`floor_monitor.SAME_THING`)."""
FEWEST_SPOTS = 4
"""It has stood at so many spots, one after the other, before it is movable: told three times."""
FEWEST_SECONDS = 2 * 86_400.0
"""And over so long: somebody who clears a room moves all in an hour."""
KEPT_SPOTS, MOST = 20, 500
"""Spots of a thing, and things, that are kept: the last ones."""


@dataclass(frozen=True)
class Movable:
    """A thing that has stood at several spots.

    Attributes:
        number: From 1.
        place: Where it is.
        extent: Its longer side as it was seen last, metres.
        spots: Where it stood and since when: x, y, metres, seconds since 1970; the last one last.
        is_learned: Whether it is told no more.
        is_undone: Whether a person wants it told, however often it moves.
    """

    number: int
    place: str
    extent: float
    spots: tuple[tuple[float, float, float], ...]
    is_learned: bool = False
    is_undone: bool = False

    def words(self) -> str:
        """Return it in words, as '2: a thing of 0.4 m in R1, at 5 spots'."""
        x, y, _ = self.spots[-1]
        told = ', undone' if self.is_undone else ''
        return (
            f'{self.number}: a thing of {self.extent:.1f} m in {self.place}, '
            f'{len(self.spots)} spots, last at {x:.1f}, {y:.1f}{told}'
        )

    def may_be(self, place: str, extent: float, position: tuple[float, float]) -> bool:
        """Tell whether a thing that was seen may be this one."""
        longer, shorter = sorted((extent, self.extent), reverse=True)
        is_alike = longer <= SAME_SIZE * shorter + 0.1
        return place == self.place and is_alike and self.away(position) <= ROAMS

    def away(self, position: tuple[float, float]) -> float:
        """Return how far a position is from the nearest spot, metres."""
        return min(math.dist(position, each[:2]) for each in self.spots)


class Movables:
    """All things that have moved; owned by whoever calls it, one thread."""

    def __init__(self) -> None:
        self._things: dict[int, Movable] = {}
        self._next = 1

    def take(
        self, seen: Iterable[tuple[str, ObjectChange]], stamp: float
    ) -> tuple[list[ObjectChange], list[Movable]]:
        """Return what of a comparison is news, and what has just been learned as movable.

        Args:
            seen: What differs from what is normal, with its place.
            stamp: Now, seconds since 1970.
        """
        used: set[int] = set()
        news, learned = [], []
        for place, change in seen:
            if change.change == Change.REMOVED:
                news.append(change)
                continue
            thing = self._thing_of(place, change, used)
            used.add(thing.number)
            stood = thing.spots[-1:] and math.dist(thing.spots[-1][:2], change.position)
            if not thing.spots or float(stood or 0.0) > ANOTHER_SPOT:
                spots = (*thing.spots, (*change.position, stamp))[-KEPT_SPOTS:]
                thing = replace(thing, extent=change.extent, spots=spots)
            is_often = len(thing.spots) >= FEWEST_SPOTS
            is_long = abs(thing.spots[-1][2] - thing.spots[0][2]) >= FEWEST_SECONDS
            if is_often and is_long and not thing.is_learned and not thing.is_undone:
                thing = replace(thing, is_learned=True)
                learned.append(thing)
            self._keep(thing)
            if not thing.is_learned:
                news.append(change)
        return news, learned

    def listed(self) -> list[Movable]:
        """Return what is movable, or was until a person undid it."""
        return [each for each in self._things.values() if each.is_learned or each.is_undone]

    def undo(self, number: int) -> Movable:
        """Have a thing told again that was learned as movable.

        Raises:
            KeyError: There is none of this number.
        """
        known = {each.number: each for each in self.listed()}
        self._things[number] = replace(known[number], is_learned=False, is_undone=True)
        return self._things[number]

    def near(self, position: tuple[float, float]) -> Movable | None:
        """Return what is movable and has stood at a position."""
        found = [each for each in self.listed() if each.away(position) <= ANOTHER_SPOT]
        return min(found, key=lambda each: each.away(position), default=None)

    def state(self) -> dict[str, Any]:
        """Return all as plain values, for `restore`."""
        things = [
            [
                each.number,
                each.place,
                each.extent,
                list(each.spots),
                each.is_learned,
                each.is_undone,
            ]
            for each in self._things.values()
        ]
        return {'things': things, 'next': self._next}

    def restore(self, values: Mapping[str, Any]) -> None:
        """Take what `state` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        found = {}
        for number, place, extent, spots, is_learned, is_undone in values['things']:
            read = tuple((float(x), float(y), float(stamp)) for x, y, stamp in spots)
            if not read or not all(math.isfinite(each) for spot in read for each in spot):
                raise ValueError('a movable thing without a spot')
            found[int(number)] = Movable(
                int(number), str(place), float(extent), read, bool(is_learned), bool(is_undone)
            )
        self._things, self._next = found, int(values['next'])

    def _thing_of(self, place: str, change: ObjectChange, used: set[int]) -> Movable:
        """Return the thing that was seen: the nearest that may be, or a new one without a spot."""
        found = [
            each
            for each in self._things.values()
            if each.number not in used and each.may_be(place, change.extent, change.position)
        ]
        if found:
            return min(found, key=lambda each: each.away(change.position))
        self._next += 1
        return Movable(self._next - 1, place, change.extent, ())

    def _keep(self, thing: Movable) -> None:
        self._things.pop(thing.number, None)
        self._things[thing.number] = thing  # the one that was seen last stands last
        if len(self._things) > MOST:
            forgotten = next(
                (number for number, each in self._things.items() if not each.is_learned),
                next(iter(self._things)),
            )
            del self._things[forgotten]
