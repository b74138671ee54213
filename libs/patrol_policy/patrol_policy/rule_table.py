"""Which places come first: classes of places by priority, and how long each may go unvisited.

The rules are a list of classes of places by falling priority, such as ``URGENT, CORRIDOR, ROOM``.
Of the places that a robot can go to, those of the first class that has somebody there are allowed.
A place's classes follow from what it is, save `URGENT`, which a place also becomes by waiting: so
each place has a rank, and a better one from the moment at which it is URGENT.

Whoever asks what comes first asks a `RuleTable`: the decision, the search that looks ahead, the
lower bounds, idleness bounds, fleet and simulation. `RuleTable.time_left` is the one function that
computes whether a place is URGENT, `RuleTable.rank` the one comparison, and `RuleTable.first`
is where the first class wins. Places are indices here.

**What was said.** The ontology has rules of its own that make a place URGENT: it was never visited,
or something was noticed there. Its word counts more than the wait. Where it said nothing (a search
looks ahead, the robot is cut off from it, a simulation has none) the wait decides.

**A new class** is one entry of the list. An entry may ask for several classes at once, and have
hours in which it counts, written as those of a place (`hours`). So ``LAB&URGENT mon-fri`` before
``URGENT`` has the robot see to laboratories that wait too long before all else on weekdays.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, tzinfo
from functools import cached_property

from patrol_policy.hours import NOT, WeeklyHours

URGENT = 'URGENT'
"""The class whose members change by waiting; all others are taken to stay as they are."""
ALERT = 'ALERT'
"""The class of places in which something was noticed: what makes them URGENT is not their wait."""
ANY = 'any'
"""In place of a class where no class of the rules has a member."""
JOINED = '&'
"""Stands between classes that a place has to be of at once."""
DEFAULT_PRIORITIES = (URGENT, 'CORRIDOR', 'ROOM')
HALF_OPEN = 1e-3
"""Seconds by which a wait must be longer than the threshold, so that rounding does not decide."""
BEHIND_ALL = 1 << 30
"""A rank behind that of every place."""


@dataclass(frozen=True)
class ClassRule:
    """One entry of the rules: places that are of all of some classes, and when it counts.

    Attributes:
        classes: Names of classes of the ontology.
        hours: When it counts; None: always.
    """

    classes: tuple[str, ...]
    hours: WeeklyHours | None = None

    @classmethod
    def parse(cls, entry: str) -> ClassRule:
        """Read an entry such as ``LAB`` or ``LAB&URGENT mon-fri 08:00-18:00``.

        Raises:
            ValueError: It is none.
        """
        names, _, hours = entry.strip().partition(' ')
        classes = tuple(names.split(JOINED))
        if not all(re.fullmatch(r'[A-Za-z_][\w.-]*', name) for name in classes):
            raise ValueError(f'{entry!r} is not the name of a class of places')
        try:
            return cls(classes, WeeklyHours.parse(hours) if hours.strip() else None)
        except ValueError as error:
            message = f'{entry!r} is not the name of a class of places and its hours: {error}'
            raise ValueError(message) from None

    @property
    def name(self) -> str:
        """The rule of a decision that follows from it."""
        return JOINED.join(self.classes)

    def counts(self, now: float, zone: tzinfo | None = None) -> bool:
        """Return whether it counts at a moment.

        Args:
            now: Seconds since 1970.
            zone: Of the clock on the wall; None: that of the machine.
        """
        return self.hours is None or self.hours.at(datetime.fromtimestamp(now, zone)) != NOT


@dataclass(frozen=True)
class Priorities:
    """Classes of places by falling priority.

    Attributes:
        entries: Names of classes of the ontology, each with its hours if it has some; with none,
            every reachable place may be chosen.

    Raises:
        ValueError: An entry is no class, or a class stands twice.
    """

    entries: tuple[str, ...] = DEFAULT_PRIORITIES

    def __post_init__(self) -> None:
        names = [rule.name for rule in self.rules]
        for position, name in enumerate(names):
            if name in names[:position]:
                raise ValueError(f'{name} stands twice in the list of rules')

    @cached_property
    def rules(self) -> tuple[ClassRule, ...]:
        """The entries, read."""
        return tuple(map(ClassRule.parse, self.entries))

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """The names of all classes, each once, whether they count now or not."""
        return tuple(dict.fromkeys(name for rule in self.rules for name in rule.classes))

    @cached_property
    def _always(self) -> tuple[str, ...] | None:
        """The names of all entries; None: some do not always count."""
        if any(rule.hours for rule in self.rules):
            return None
        return tuple(rule.name for rule in self.rules)

    def at(self, now: float, zone: tzinfo | None = None) -> tuple[str, ...]:
        """Return the names of the entries that count at a moment; see `ClassRule.counts`."""
        if self._always is not None:
            return self._always
        return tuple(rule.name for rule in self.rules if rule.counts(now, zone))


def is_by_waiting(rule: str) -> bool:
    """Return whether an entry, by its name, is for places that are URGENT."""
    return URGENT in rule.split(JOINED)


def priorities_expected(entries: Sequence[str]) -> str | None:
    """Ask for classes of places, each once."""
    try:
        Priorities(tuple(entries))
    except ValueError as error:
        return f'names of classes of places, each once ({error})'
    return None


@dataclass(frozen=True)
class RuleTable:
    """The rules as data: for each place its rank, and how long it may go unvisited.

    Attributes:
        order: The entries that count now, by falling priority.
        base: For each place its rank while it is not URGENT: the position in ``order`` of the first
            entry that it is of; as many as there are entries where it is of none.
        urgent: The same while it is URGENT, which is no worse.
        limits: For each place the seconds without a visit after which it is URGENT; inf: never.
    """

    order: tuple[str, ...]
    base: Sequence[int]
    urgent: Sequence[int]
    limits: Sequence[float]

    @classmethod
    def of(
        cls,
        order: tuple[str, ...],
        places: Sequence[str],
        classes: Mapping[str, frozenset[str]],
        limit_of: Callable[[str], float],
    ) -> RuleTable:
        """Return the table of some places.

        Args:
            order: The names of the entries that count now, by falling priority.
            places: Their names.
            classes: The classes of each place; one that is missing is in none.
            limit_of: Returns after how many seconds a place is URGENT.
        """
        entries = [frozenset(name.split(JOINED)) for name in order]

        def rank(kinds: frozenset[str]) -> int:
            mine = (at for at, wanted in enumerate(entries) if wanted <= kinds)
            return next(mine, len(order))

        nothing = frozenset[str]()
        # Many places are of the same classes.
        ranks = {
            kinds: (rank(kinds - {URGENT}), rank(kinds | {URGENT}))
            for kinds in {nothing, *classes.values()}
        }
        both = [ranks[classes.get(place, nothing)] for place in places]
        limits = [limit_of(place) for place in places]
        return cls(order, [base for base, _ in both], [urgent for _, urgent in both], limits)

    @property
    def has_urgent(self) -> bool:
        """Whether waiting changes a rank at all."""
        return any(map(operator.lt, self.urgent, self.base))

    def time_left(self, place: int, age: float, said: bool | None = None) -> float:
        """Return the seconds until a place is URGENT; below 0: it is. inf: it never is by waiting.

        Args:
            place: The place.
            age: Seconds since it was visited.
            said: Whether the ontology holds it URGENT; None: it said nothing.
        """
        if said:
            return -math.inf
        left = self.limits[place] + HALF_OPEN / 2.0 - age
        # It counts whole seconds: what it does not hold URGENT now may be in a moment.
        return left if said is None else max(left, 0.0)

    def turns_in(self, place: int, age: float, said: bool | None = None) -> float:
        """Return the seconds until a place ranks better for being URGENT; inf: it never does.

        See `time_left`.
        """
        if self.urgent[place] == self.base[place]:
            return math.inf
        return self.time_left(place, age, said)

    def rank(self, place: int, age: float, said: bool | None = None) -> int:
        """Return how early a place comes, 0 first; see `time_left`."""
        return self.rank_from(place, self.turns_in(place, age, said))

    def rank_from(self, place: int, turns_in: float) -> int:
        """Return the rank of a place that turns in so many seconds; see `turns_in`."""
        return self.urgent[place] if turns_in < 0.0 else self.base[place]

    def name_of(self, rank: int) -> str:
        """Return the entry that has a rank; `ANY` for places of none."""
        return self.order[rank] if rank < len(self.order) else ANY

    # The same for searches, which ask millions of times: not the age of each place is compared, but
    # the moment at which its rank changes, and that is known from visit to visit.

    @cached_property
    def due_after(self) -> list[float]:
        """For each place the seconds from a visit until it ranks better; inf: it never does."""
        return [self.turns_in(place, 0.0) for place in range(len(self.base))]

    def due_times(
        self, now: float, seen: Sequence[float], said: Mapping[int, bool | None] | None = None
    ) -> list[float]:
        """Return for each place the moment after which it ranks as URGENT, seconds.

        Args:
            now: Seconds.
            seen: When each place was visited last.
            said: Which places the ontology holds URGENT, or does not; of others it said nothing.
        """
        found = [last + after for last, after in zip(seen, self.due_after, strict=True)]
        for place, word in (said or {}).items():
            found[place] = now + self.turns_in(place, now - seen[place], word)
        return found

    def first(
        self, places: Iterable[int], now: float, due: Sequence[float] | Mapping[int, float]
    ) -> list[int]:
        """Return those of some places that come first: the first class that has somebody wins.

        Args:
            places: The places.
            now: Seconds.
            due: When each ranks as URGENT, see `due_times`.
        """
        base, urgent = self.base, self.urgent
        best = BEHIND_ALL
        found: list[int] = []
        for place in places:
            rank = urgent[place] if due[place] < now else base[place]
            if rank < best:
                best, found = rank, [place]
            elif rank == best:
                found.append(place)
        return found

    def broken(
        self,
        walk: Sequence[int],
        times: Sequence[float],
        places: Sequence[int],
        onward: Sequence[Sequence[int]],
        resting: Collection[int] = (),
    ) -> Iterator[tuple[int, int]]:
        """Yield the steps of a walk that the rules forbid when it is repeated for ever.

        Args:
            walk: The stops that are entered, one after the other; the walk begins at the last one.
            times: When each is left, seconds; the last one is how long the walk takes.
            places: The place of each stop; stops behind the places are entered to charge, which no
                rule forbids.
            onward: For each place the places that may be entered from there.
            resting: Places that are left out of the walk until they are URGENT.

        Yields:
            The position of the step, and a place that comes first instead.
        """
        base, urgent, after, count = self.base, self.urgent, self.due_after, len(self.base)
        # For the first step: as the places were visited the time before. What is not on the walk is
        # taken not to be due.
        due = [math.inf] * count
        for stop, then in zip(walk, times, strict=True):
            due[places[stop]] = then - times[-1] + after[places[stop]]
        now, here = 0.0, places[walk[-1]]
        due[here] = after[here]
        for step, (stop, then) in enumerate(zip(walk, times, strict=True)):
            if stop < count:
                rank = base[stop]
                if rank and (due[stop] < now or stop in resting):
                    rank = urgent[stop]
                if rank:
                    for other in onward[here]:
                        if (urgent[other] if due[other] < now else base[other]) < rank:
                            yield step, other
                            break
            here, now = places[stop], then
            due[here] = then + after[here]

    def possibly_first(
        self, ages: Mapping[int, float], is_known: Callable[[int], bool]
    ) -> list[int]:
        """Return those of some places that may come first when not all pasts are known.

        Args:
            ages: By place, seconds since it was visited, or at least so many.
            is_known: Whether a place's age is known.
        """
        worst = {place: self.rank(place, age) for place, age in ages.items()}
        least = min(worst.values(), default=BEHIND_ALL)
        return [
            place
            for place in ages
            # One that waits longer than is known may rank as URGENT.
            if worst[place] <= least
            or (
                not is_known(place)
                and self.urgent[place] <= least
                and math.isfinite(self.due_after[place])
            )
        ]

    def is_held(self, place: int, others: Iterable[int]) -> bool:
        """Return whether a place comes after one of the others as long as it is not URGENT.

        A robot at the place between them enters it only when it is, then.
        """
        base = self.base[place]
        return self.urgent[place] < base and any(self.base[other] < base for other in others)
