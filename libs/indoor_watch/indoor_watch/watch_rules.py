"""What a person wants to know of: checks and policies in a file `watch.yaml`.

    rules:
      front door at night:
        door: D1
        is: closed
        hours: daily 20:00-06:00
        severity: alert
      nobody after work:
        person: nobody
        places: [R1, R2, R3, R4]
        hours: mon-fri 20:00-06:00
        persistence: 2 looks
      the marker of R1: {marker: 14}
      free corridor:
        object: none
        places: [C1]
        severity: notice

With `is: usual`, `person: usual` or `light: usual` the rule is broken by what is unusual for the
hour, which the robot learns from its visits.

A rule says how something is to be; whatever is seen of it in another state, within its hours and
for long enough, is an event of its severity. `words` says a rule back, so that a person can check
it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from enum import IntEnum
from pathlib import Path
from typing import Any

from indoor_watch.habits import UNUSUAL_BELOW
from indoor_watch.observations import USUAL, Kind, Observation
from patrol_policy.hours import WeeklyHours
from strict_files.suggestions import nearest
from strict_files.yaml_file import EntryError, read_table


class Level(IntEnum):
    """How bad it is when a rule is broken."""

    NOTICE = 1
    WARNING = 2
    ALERT = 3


ALL = ('all', 'any', 'every')
KEYS = (
    'is',
    'places',
    'hours',
    'persistence',
    'severity',
    'confidence',
    'unverified',
    'accepted',
    'pictures',
)
BY_A_PERSON = 'by a person'
ALWAYS = WeeklyHours.parse('daily 00:00-24:00')


@dataclass(frozen=True)
class WatchRule:
    """How something is to be.

    Attributes:
        kind: What it is about.
        subject: Which door or marker; empty: all.
        wanted: How it is to be, of what its kind may be wanted to be.
        places: Where; empty: everywhere.
        hours: When.
        looks: In how many looks it must have been seen otherwise.
        seconds: For how long it must have been seen otherwise.
        level: How bad it is otherwise.
        confidence: Observations below it do not count.
        unverified: How bad it is when one look alone says so, and nobody could look again in time;
            None: a person in one picture is a WARNING, as a picture may deceive; all else as level.
        accepted: After so long, seconds, what was seen is normal, unless a person says otherwise;
            inf: a person alone says so.
        name: Of the person's choice; empty: it has none.
        sharp: Whether people in its pictures are kept as they are; else they are blurred.
    """

    kind: Kind
    subject: str
    wanted: str
    places: tuple[str, ...] = ()
    hours: WeeklyHours = ALWAYS
    looks: int = 1
    seconds: float = 0.0
    level: Level = Level.ALERT
    confidence: float = 0.6
    unverified: Level | None = None
    accepted: float = math.inf
    name: str = ''
    sharp: bool = False

    @property
    def unverified_level(self) -> Level:
        """How bad it is when nobody could look again."""
        if self.unverified is not None:
            return self.unverified
        return min(self.level, Level.WARNING) if self.kind == Kind.PERSON else self.level

    def broken_by(self, seen: Observation, moment: datetime) -> bool:
        """Tell whether an observation is otherwise than this rule wants, at a local time."""
        if seen.kind != self.kind or not self.is_about(seen.subject, seen.place):
            return False
        if seen.confidence < self.confidence or seen.state == self.wanted:
            return False
        if self.wanted == USUAL and (seen.usual is None or seen.usual >= UNUSUAL_BELOW):
            return False
        if self.kind == Kind.OBJECT:
            # That something left is as the rule wants it; what the map lacks another rule asks.
            of_the_map = seen.state in ('unmapped', 'movable')
            if seen.state == 'removed' or of_the_map != (self.wanted == 'mapped'):
                return False
        if self.kind == Kind.PERSON and self.wanted == 'nobody' and seen.state != 'seen':
            return False
        return self.hours.at(moment) == 'must'

    def is_about(self, subject: str, place: str) -> bool:
        """Tell whether it asks for a thing in a place, at whatever time."""
        return self.subject in ('', subject) and (not self.places or place in self.places)

    def lasting(self, looks: int, seconds: float) -> bool:
        """Tell whether what was seen in so many looks, over so long, counts."""
        return looks >= self.looks and seconds >= self.seconds

    def words(self) -> str:
        """Say the rule back, its name first."""
        where = f' in {_listed(self.places)}' if self.places else ''
        when = 'always' if self.hours == ALWAYS else f'in the hours {self.hours.text}'
        subject = f' {self.subject}' if self.subject else 's'
        wrong = self.kind.wrong.format(subject=subject, wanted=self.wanted)
        if self.kind == Kind.PERSON and self.wanted == USUAL:
            wrong = 'a person, or nobody,'
        if self.wanted == USUAL:
            wrong = f'{wrong.removesuffix(" not usual")} as is unusual for the hour'
        if self.wanted == 'mapped':
            wrong = 'what the map does not show, or moves often,'
        lasting = ''
        if self.looks > 1:
            lasting = f', seen in {self.looks} looks'
        elif self.seconds:
            lasting = f', seen for {self.seconds:g} s'
        said = f'{when} {wrong}{where}{lasting} is {_article(self.level)} {self.level.name}'
        if self.unverified is not None:
            said += f', unverified {_article(self.unverified)} {self.unverified.name}'
        if math.isfinite(self.accepted):
            said += f', normal after {self.accepted / 86_400.0:g} days'
        return f'{self.name}: {said}' if self.name else said


def read_watch_file(
    path: Path, places: Sequence[str] = (), doors: Sequence[str] = ()
) -> list[WatchRule]:
    """Read a person's rules.

    Args:
        path: The file: a mapping `rules` from a name to the rule.
        places: The places there are; empty: any name is taken.
        doors: The doors there are, likewise.

    Raises:
        FileError: One line: where, what was wrong, what was expected.
    """

    def read(name: str, entry: Mapping[str, Any]) -> WatchRule:
        return replace(rule_from(entry, places, doors), name=str(name))

    return read_table(path, 'rules', "'door: D1'", read)


def severity_of(
    rules: Iterable[WatchRule], seen: Observation, moment: datetime
) -> tuple[int, WatchRule | None]:
    """Return the worst rule that an observation breaks, and its level; 0 and None where none is."""
    broken = [each for each in rules if each.broken_by(seen, moment)]
    worst = max(broken, key=lambda each: each.level, default=None)
    return (0, None) if worst is None else (int(worst.level), worst)


def rule_from(
    entry: Mapping[str, Any], places: Sequence[str] = (), doors: Sequence[str] = ()
) -> WatchRule:
    """Return the rule that a mapping describes.

    Args:
        entry: As YAML reads it.
        places: The places there are; empty: any name is taken.
        doors: The doors there are, likewise.

    Raises:
        ValueError: What was wrong, and what was expected.
    """
    kinds = [key for key in entry if key in list(Kind)]
    unknown = [key for key in entry if key not in KEYS and key not in kinds]
    if unknown:
        known = nearest(unknown[0], [*Kind, *KEYS])
        raise EntryError(unknown[0], f'unknown key, expected {known}')
    if len(kinds) != 1:
        raise ValueError(f'expected one of {", ".join(Kind)}, got {len(kinds)} of them')
    kind = Kind(kinds[0])
    subject, wanted = _wanted(kind, entry)
    if kind == Kind.DOOR and doors and subject and subject not in doors:
        raise ValueError(f'there is no door {subject!r}, expected {nearest(subject, doors)}')
    if kind == Kind.DOOR and subject and 'places' in entry:
        # A door is told in one of the two places it joins: in the other the rule would be silent.
        raise EntryError('places', f"expected none beside 'door: {subject}', which says where")
    looks, seconds = _persistence(entry.get('persistence', '1 look'))
    return WatchRule(
        kind,
        subject,
        wanted,
        _places(entry['places'], places) if 'places' in entry else (),
        _hours(entry.get('hours')),
        looks,
        seconds,
        _level(entry.get('severity', 'alert')),
        _confidence(entry.get('confidence', 0.6)),
        _level(entry['unverified'], 'unverified') if 'unverified' in entry else None,
        _accepted(entry.get('accepted', BY_A_PERSON)),
        sharp=_is_sharp(entry.get('pictures', 'blurred')),
    )


def with_baseline(rules: Sequence[WatchRule]) -> tuple[WatchRule, ...]:
    """Return rules with one for what the map does not show, where no rule asks for that."""
    if any(each.kind == Kind.OBJECT and each.wanted == 'mapped' for each in rules):
        return tuple(rules)
    return (*rules, BASELINE)


def _wanted(kind: Kind, entry: Mapping[str, Any]) -> tuple[str, str]:
    value, wanted = str(entry[kind]), entry.get('is')
    if kind.named:
        subject = '' if value in ALL else value
        if entry[kind] is None or isinstance(entry[kind], list | Mapping):
            raise ValueError(f'{kind}: got {entry[kind]!r}, expected {kind.named}')
        if kind == Kind.MARKER and subject and not re.fullmatch(r'\d{1,9}', subject, re.ASCII):
            raise ValueError(f'{kind}: got {value!r}, expected {kind.named}')
        wanted = (
            str(wanted) if wanted is not None else kind.wanted[0] if len(kind.wanted) == 1 else ''
        )
    else:
        if wanted is not None:
            raise ValueError(f"{kind} takes no 'is', expected '{kind}: {kind.wanted[0]}'")
        # YAML reads on and off as truth values.
        subject, wanted = '', {'True': 'on', 'False': 'off'}.get(value, value)
    if wanted not in kind.wanted:
        key = f'{kind} {subject or ""}'.rstrip()
        raise ValueError(f'{key}: got {wanted!r}, expected {nearest(str(wanted), kind.wanted)}')
    return subject, wanted


def _places(value: Any, known: Sequence[str]) -> tuple[str, ...]:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError('places: expected a list of names')
    if not names:
        raise ValueError("places: got none, expected names, or no 'places' for everywhere")
    for name in names:
        if known and name not in known:
            raise ValueError(f'there is no place {name!r}, expected {nearest(name, known)}')
    return tuple(names)


def _hours(value: Any) -> WeeklyHours:
    if value is None:
        return ALWAYS
    text = str(value)
    try:
        # A time alone is meant daily.
        return WeeklyHours.parse(f'daily {text}' if re.match(r'\d', text) else text)
    except ValueError as error:
        raise ValueError(f'hours: {error}') from None


def _persistence(value: Any) -> tuple[int, float]:
    match = re.fullmatch(r'(\d+(?:\.\d+)?) ?(looks?|visits?|s|seconds?)', str(value))
    if match is None:
        raise ValueError(f"persistence: got {value!r}, expected such as '2 looks' or '5 s'")
    number, unit = float(match[1]), match[2]
    if unit.startswith(('look', 'visit')):
        if number < 1 or number != int(number):
            raise ValueError(f'persistence: got {value!r}, expected 1 look or more')
        return int(number), 0.0
    return 1, number


def _is_sharp(value: Any) -> bool:
    if value not in ('blurred', 'sharp'):
        raise ValueError(f"pictures: got {value!r}, expected 'blurred' or 'sharp'")
    return bool(value == 'sharp')


def _accepted(value: Any) -> float:
    if value == BY_A_PERSON:
        return math.inf
    match = re.fullmatch(r'after (\d+(?:\.\d+)?) ?(days?|hours?)', str(value))
    if match is None:
        raise ValueError(f"accepted: got {value!r}, expected 'after 3 days' or '{BY_A_PERSON}'")
    return float(match[1]) * (86_400.0 if match[2].startswith('day') else 3600.0)


def _level(value: Any, key: str = 'severity') -> Level:
    try:
        return Level[str(value).upper()]
    except KeyError:
        names = [each.name.lower() for each in Level]
        raise ValueError(f'{key}: got {value!r}, expected {nearest(str(value), names)}') from None


def _confidence(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        raise ValueError(f'confidence: got {value!r}, expected a number from 0 to 1')
    return float(value)


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f'{", ".join(names[:-1])} or {names[-1]}'


def _article(level: Level) -> str:
    return 'an' if level.name[0] in 'AEIOU' else 'a'


DEFAULT_RULES = (
    rule_from({'object': 'none', 'severity': 'notice'}),
    rule_from({'marker': 'all', 'severity': 'notice'}),
    rule_from({'view': 'clear', 'severity': 'warning'}),
)
"""Where a person says nothing: changes are events, and nobody is called."""

BASELINE = rule_from({'object': 'mapped', 'severity': 'notice', 'accepted': 'after 7 days'})
"""What stands on the floor at the first look and is not on the map: shown once, for approval."""
