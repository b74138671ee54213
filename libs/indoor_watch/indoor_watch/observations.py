"""An observation: one thing that was seen once, how sure, where, when, and the evidence for it.

What was not in view makes no observation: it is not known, and it is not "gone".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import Enum, StrEnum, auto
from types import MappingProxyType
from typing import Any

USUAL = 'usual'
"""What a rule may ask for where the robot learns a kind's hours: that it is as at other times."""


_PLAINLY: Mapping[str, str] = MappingProxyType({})


class Joined(Enum):
    """What makes two sightings of a thing without a name one thing."""

    BY_SPOT = auto()
    BY_PLACE = auto()
    ALWAYS = auto()


class Kind(StrEnum):
    """What an observation is about: one entry for all that differs between kinds.

    Args:
        value: Its name: in rules (`door: D1`), observations, messages, and the ontology's classes
            (`DoorObservation`).
        states: The states that it knows.
        wanted: Of these, or else, what a rule may ask for.
        wrong: What breaks a rule, in words, with {subject} and {wanted}.
        named: What names one; empty: the position, or the place, tells.
        learned: The state whose hours are learned, so that a rule may ask for what is usual.
        said: States that are said otherwise than `door D1 is ajar`, with {thing}.
        joined: What makes two sightings of it one thing.

    A test goes through all of them; CONTRIBUTING.md says what a new kind needs beside its entry.
    """

    DOOR = (
        'door',
        ('open', 'closed', 'ajar'),
        ('open', 'closed', 'ajar'),
        'door{subject} not {wanted}',
        "the name of a door, or 'all'",
        'open',
    )
    OBJECT = (
        'object',
        ('appeared', 'removed', 'moved', 'unmapped', 'movable'),
        # Nothing new; nothing that the map lacks.
        ('none', 'mapped'),
        'anything that was not there before',
        '',
        '',
        {
            'appeared': '{thing} has appeared',
            'moved': '{thing} was moved',
            'unmapped': '{thing} stands where the map shows none',
            'movable': '{thing} moves often, is movable from now on',
        },
    )
    MARKER = (
        'marker',
        ('here', 'moved', 'missing', 'double', 'unknown'),
        ('here',),
        'marker{subject} not where it hangs',
        "the number that a marker shows, or 'all'",
        '',
        {'moved': '{thing} was moved'},
    )
    # That nobody is there only pictures tell; the lidar alone tells that nobody walks.
    PERSON = (
        'person',
        ('seen', 'nobody', 'nobody walks'),
        ('nobody',),
        'a person',
        '',
        'seen',
        {'seen': '{thing} was seen', 'nobody': 'nobody is', 'nobody walks': 'nobody walks'},
        Joined.BY_PLACE,
    )
    LIGHT = ('light', ('on', 'off'), ('on', 'off'), 'the light not {wanted}', '', 'on')
    # It is the camera that is covered, wherever the robot is.
    VIEW = (
        'view',
        ('clear', 'changed', 'blocked'),
        ('clear',),
        'a view that changed or is blocked',
        '',
        '',
        _PLAINLY,
        Joined.ALWAYS,
    )
    WAY = ('way', ('free', 'blocked'), ('free',), 'a way that is not free')

    states: tuple[str, ...]
    wanted: tuple[str, ...]
    wrong: str
    named: str
    learned: str
    said: Mapping[str, str]
    joined: Joined

    def __new__(
        cls,
        value: str,
        states: tuple[str, ...] = (),
        wanted: tuple[str, ...] = (),
        wrong: str = '',
        named: str = '',
        learned: str = '',
        said: Mapping[str, str] = _PLAINLY,
        joined: Joined = Joined.BY_SPOT,
    ) -> Kind:
        """Make a member of its entry."""
        member = str.__new__(cls, value)
        member._value_ = value
        member.states, member.wrong, member.named, member.learned = states, wrong, named, learned
        member.wanted = (*wanted, USUAL) if learned else wanted
        member.said, member.joined = said, joined
        return member

    def words(self, state: str, subject: str = '') -> str:
        """Say a state of a thing, as 'door D1 is ajar'."""
        thing = f'{self} {subject}' if subject else str(self)
        return self.said.get(state, f'{{thing}} is {state}').format(thing=thing)


@dataclass(frozen=True)
class Observation:
    """One thing that was seen once.

    Attributes:
        kind: What it is about.
        state: What was seen of it, of its kind's states.
        place: The place it is in.
        subject: Which door or marker; empty where the position tells.
        position: Where, map frame, metres; None where that is not known.
        confidence: 0 to 1.
        stamp: When, seconds since 1970.
        robot: Who saw it.
        evidence: File with the picture or sweep, relative to the evidence's folder; or empty.
        compared_with: What it was compared with: a file, or the stamp of a reference.
        sensor: What saw a person, or that there is none: camera or lidar; empty: not known.
        usual: How likely this state is at its hour, 0 to 1; None: that is not known.
        seen_from: Where the robot was, map frame, metres; None where that is not known.

    Raises:
        ValueError: A state that the kind does not know, or a number that is none.
    """

    kind: Kind
    state: str
    place: str
    subject: str = ''
    position: tuple[float, float] | None = None
    confidence: float = 1.0
    stamp: float = 0.0
    robot: str = ''
    evidence: str = ''
    compared_with: str = ''
    seen_from: tuple[float, float] | None = None
    usual: float | None = None
    sensor: str = ''

    def __post_init__(self) -> None:
        if self.state not in self.kind.states:
            expected = ', '.join(self.kind.states)
            raise ValueError(f'{self.kind} {self.state!r}: expected one of {expected}')
        numbers = (
            self.confidence,
            self.stamp,
            *(self.position or ()),
            *(self.seen_from or ()),
        )
        if not all(map(math.isfinite, numbers)) or not 0.0 <= self.confidence <= 1.0:
            raise ValueError(f'{self.kind} {self.state}: expected finite numbers, got {numbers}')

    def to_json(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {name: value for name, value in asdict(self).items() if value not in ('', None)}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Observation:
        """Return what `to_json` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        given = dict(values)
        for name in ('position', 'seen_from'):
            if (point := given.get(name)) is not None:
                x, y = point
                given[name] = (float(x), float(y))
        return cls(**{**given, 'kind': Kind(given['kind'])})

    def words(self) -> str:
        """Return it in words, as 'door D1 is ajar in C1'."""
        where = f' in {self.place}' if self.place else ''
        return f'{self.kind.words(self.state, self.subject)}{where}'
