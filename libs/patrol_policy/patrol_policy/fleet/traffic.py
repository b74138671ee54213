"""Right of way between robots: a rule that each computes from what all publish, without deadlock.

Places in which two robots can pass are wide, the others narrow; the same holds for the ways (doors)
between two places. Narrow places that narrow or wide ways join are one block, as a single-track
line has them.

- A narrow way has at most one robot on it.
- A block is entered by one robot at a time. Inside, robots move as if it were theirs alone.
- Of those who want the same, the one whose goal is oldest goes first (its priority), then the first
  by name. Somebody who only stays in a block that others want has the priority of the first of them
  and leaves for the nearest wide place: priority inheritance, as PIBT has it (Okumura et al. 2022).

Nobody holds a way while it waits for another: on a way a robot drives on to its end. Out of a block
leads a way into a wide place, which always has room. So nobody waits in a circle. Two robots that
begin inside one block leave it one after the other, who is nearer to its end first.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Intention:
    """What a robot publishes of its way.

    Attributes:
        robot: Its name.
        place: The place it is in, or left last.
        heading_to: The neighbouring place it wants to go to next; empty: it stays.
        since: Since when it wants to reach what it is heading for in the end, seconds.
        is_moving: Whether it is on its way to `heading_to`.
        is_fixed: Whether it cannot leave now, as it charges or has failed.
    """

    robot: str
    place: str
    heading_to: str = ''
    since: float = 0.0
    is_moving: bool = False
    is_fixed: bool = False


@dataclass(frozen=True)
class Layout:
    """Which places and ways are wide enough for two; the others are not.

    Attributes:
        places: Wide places.
        passages: Wide ways, each as a pair of places.
    """

    places: frozenset[str] = frozenset()
    passages: frozenset[frozenset[str]] = frozenset()

    @classmethod
    def of(cls, places: Iterable[str], passages: Iterable[str]) -> Layout:
        """Return the layout of names of places and of ways written as `A B`."""
        return cls(frozenset(places), frozenset(frozenset(passage.split()) for passage in passages))


@dataclass(frozen=True)
class RightOfWay:
    """What the rule says to one robot.

    Attributes:
        go: Whether it may leave now for `place`.
        place: Where it wants to go, or has to in order to give way.
        because: Why it has to wait or give way, in words; empty: nothing stands against it.
        other: The robot it waits for or gives way to.
    """

    go: bool
    place: str
    because: str = ''
    other: str = ''


@dataclass
class _Traffic:
    neighbours: Mapping[str, Collection[str]]
    layout: Layout
    blocks: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for start in sorted(self.neighbours):
            if start in self.layout.places or start in self.blocks:
                continue
            number, queue = len(self.blocks), deque([start])
            self.blocks[start] = number
            while queue:
                for other in self.neighbours.get(queue.popleft(), ()):
                    if other not in self.layout.places and other not in self.blocks:
                        self.blocks[other] = number
                        queue.append(other)

    def to_wide(self, place: str) -> tuple[float, str]:
        """Return how many ways lead to the nearest wide place, and the first step there."""
        seen, queue = {place}, deque([(place, '', 0)])
        while queue:
            at, first, steps = queue.popleft()
            if at in self.layout.places:
                return steps, first or at
            for other in sorted(self.neighbours.get(at, ())):
                if other not in seen:
                    seen.add(other)
                    queue.append((other, first or other, steps + 1))
        return math.inf, place

    def order(self, robot: Intention) -> tuple[float, float, str]:
        """Return the order in which robots leave one block."""
        return self.to_wide(robot.place)[0], *_priority(robot)


def right_of_way(
    intentions: Sequence[Intention],
    robot: str,
    neighbours: Mapping[str, Collection[str]],
    layout: Layout,
) -> RightOfWay:
    """Return whether a robot may go where it wants to now.

    Args:
        intentions: Of all robots that were heard, this one's too; their order does not matter.
        robot: The robot's name.
        neighbours: The places beside each place.
        layout: What is wide.

    Raises:
        ValueError: The robot is not among the intentions.
    """
    me = next((each for each in intentions if each.robot == robot), None)
    if me is None:
        raise ValueError(f'{robot} has no intention, expected one of each robot')
    traffic = _Traffic(neighbours, layout)
    others = [each for each in intentions if each.robot != robot]
    if not me.heading_to:
        return _stay(me, others, traffic)
    passage = frozenset((me.place, me.heading_to))
    name = f'the way {me.place} - {me.heading_to}'
    entered, here = traffic.blocks.get(me.heading_to), traffic.blocks.get(me.place)
    for other in sorted(others, key=lambda each: (each.since, each.robot)):
        theirs = frozenset((other.place, other.heading_to))
        if passage not in layout.passages and theirs == passage:
            if other.is_moving:
                return RightOfWay(False, me.heading_to, f'{other.robot} is on {name}', other.robot)
            if other.heading_to and not other.is_fixed and _is_first(other, me, others, traffic):
                return RightOfWay(
                    False, me.heading_to, f'{other.robot} goes first on {name}', other.robot
                )
        if entered is None:
            continue
        inside = traffic.blocks.get(other.place) == entered
        coming = traffic.blocks.get(other.heading_to) == entered
        if entered != here and (inside or (coming and other.is_moving)):
            return RightOfWay(
                False,
                me.heading_to,
                f'{me.heading_to} is narrow, and {other.robot} is in {other.place}'
                if inside
                else f'{me.heading_to} is narrow, and {other.robot} is on its way to '
                f'{other.heading_to}',
                other.robot,
            )
        if entered != here and coming and not other.is_fixed and _priority(other) < _priority(me):
            return RightOfWay(
                False,
                me.heading_to,
                f'{other.robot} goes first to {other.heading_to}, where there is room for one',
                other.robot,
            )
        # Both began in this block: who is nearer to its end leaves first.
        both = entered == here and inside and not other.is_fixed
        if both and (other.is_moving or traffic.order(other) < traffic.order(me)):
            because = f'{other.robot} leaves {other.place} first'
            return RightOfWay(False, me.heading_to, because, other.robot)
    return RightOfWay(True, me.heading_to)


def may_be_contested(
    intentions: Sequence[Intention],
    robot: str,
    neighbours: Mapping[str, Collection[str]],
    layout: Layout,
) -> bool:
    """Return whether another robot, whatever it wants next, may want what this one is to use.

    Where none can, nobody needs to hear of an intention before it is carried out.

    Args:
        intentions: Of all robots that were heard, this one's too.
        robot: The robot's name.
        neighbours: The places beside each place.
        layout: What is wide.
    """
    me = next((each for each in intentions if each.robot == robot), None)
    if me is None or not me.heading_to:
        return False
    blocks = _Traffic(neighbours, layout).blocks
    ends = (me.place, me.heading_to)
    is_narrow = frozenset(ends) not in layout.passages
    entered = blocks.get(me.heading_to)
    for other in intentions:
        if other.robot == robot:
            continue
        for at in {other.place, other.heading_to or other.place}:
            if is_narrow and at in ends:
                return True
            if entered is not None and any(
                blocks.get(place) == entered for place in (at, *neighbours.get(at, ()))
            ):
                return True
    return False


def _is_first(
    other: Intention, me: Intention, others: Sequence[Intention], traffic: _Traffic
) -> bool:
    """Return whether another robot that wants the same way from its other end goes before."""
    # One that leaves a block frees it; one that wants in cannot before.
    leaves = traffic.blocks.get(me.place), traffic.blocks.get(other.place)
    if leaves[0] != leaves[1] and None in leaves:
        return leaves[1] is not None
    return _priority(other) < _priority(me)


def _stay(me: Intention, others: Sequence[Intention], traffic: _Traffic) -> RightOfWay:
    """Return whether a robot that wants to stay may, or has to give way."""
    block = traffic.blocks.get(me.place)
    if block is None or me.is_fixed:
        return RightOfWay(True, me.place)
    wanting = [
        other
        for other in others
        if traffic.blocks.get(other.heading_to) == block
        and traffic.blocks.get(other.place) != block
    ]
    steps, first = traffic.to_wide(me.place)
    if not wanting or not math.isfinite(steps):
        return RightOfWay(True, me.place)
    other = min(wanting, key=_priority)
    return RightOfWay(
        True,
        first,
        f'{other.robot} wants to {other.heading_to}, and {me.place} is narrow',
        other.robot,
    )


def _priority(intention: Intention) -> tuple[float, str]:
    return intention.since, intention.robot
