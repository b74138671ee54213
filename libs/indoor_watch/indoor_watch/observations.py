"""An observation: one thing that was seen once, how sure, where, when, and the evidence for it.

What was not in view makes no observation: it is not known, and it is not "gone".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any


class Kind(StrEnum):
    """What an observation is about."""

    DOOR = 'door'
    OBJECT = 'object'
    MARKER = 'marker'
    PERSON = 'person'
    LIGHT = 'light'
    VIEW = 'view'
    WAY = 'way'


STATES: Mapping[Kind, tuple[str, ...]] = {
    Kind.DOOR: ('open', 'closed', 'ajar'),
    Kind.OBJECT: ('appeared', 'removed', 'moved'),
    Kind.MARKER: ('here', 'moved', 'missing', 'double', 'unknown'),
    Kind.PERSON: ('seen', 'nobody', 'nobody walks'),
    Kind.LIGHT: ('on', 'off'),
    Kind.VIEW: ('clear', 'changed', 'blocked'),
    Kind.WAY: ('free', 'blocked'),
}
"""The states that each kind knows.

Of persons: that nobody is there only pictures tell; the lidar alone tells that nobody walks.
"""


@dataclass(frozen=True)
class Observation:
    """One thing that was seen once.

    Attributes:
        kind: What it is about.
        state: What was seen of it, of `STATES`.
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
        if self.state not in STATES[self.kind]:
            expected = ', '.join(STATES[self.kind])
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
        if self.state == 'nobody':
            return f'nobody is{where}'
        if self.state == 'nobody walks':
            return f'nobody walks{where}'
        subject = f' {self.subject}' if self.subject else ''
        verb = {'seen': 'was', 'appeared': 'has', 'missing': 'is', 'moved': 'was'}.get(
            self.state, 'is'
        )
        return f'{self.kind}{subject} {verb} {self.state}{where}'
