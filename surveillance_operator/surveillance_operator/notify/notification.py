"""A notification: one call for an incident, as it goes to people and programs."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from strict_files.one_line import clean
from surveillance_runtime.incidents import IncidentCall, IncidentUpdate


@dataclass(frozen=True)
class Notification:
    """One call for an incident.

    Attributes:
        key: The same for the same call, also when it is sent twice.
        text: One sentence.
        kind, name: What it is about, as `incidents.Cause`.
        node: Who tells of it.
        robot: Whose mission it is.
        over: Whether it is over.
        at: When, seconds since 1970.
        event: What the observer saw: number, kind, seen, subject, place, position, rule; empty
            where it is of something else.
        pictures: Files that show it, the first and the last sighting.
        action: What a person is to do; empty: nobody knows.
    """

    key: str
    text: str
    kind: str
    name: str
    node: str
    robot: str
    over: bool
    at: float
    event: Mapping[str, Any] = field(default_factory=dict)
    pictures: tuple[str, ...] = ()
    action: str = ''

    @property
    def subject(self) -> str:
        """Return a short line."""
        word = 'all clear' if self.over else 'alarm'
        return clean(f'{self.robot}: {word}: {self.kind} {self.name}')

    def to_json(self) -> dict[str, Any]:
        """Return it as plain values, with the names of pictures but not where they lie."""
        return {
            'key': self.key,
            'text': self.text,
            'kind': self.kind,
            'name': self.name,
            'node': self.node,
            'robot': self.robot,
            'over': self.over,
            'at': round(self.at, 3),
            **({'event': dict(self.event)} if self.event else {}),
            **({'action': self.action} if self.action else {}),
        }

    def kept(self) -> str:
        """Return it as the outbox keeps it, see `from_kept`."""
        return json.dumps({**self.to_json(), 'pictures': list(self.pictures)})

    @classmethod
    def from_kept(cls, kept: Any) -> Notification:
        """Return the notification that `kept` gave, whose text was read as JSON.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        texts = [each.name for each in fields(cls) if each.type == 'str']
        if not isinstance(kept, dict) or any(type(kept.get(name, '')) is not str for name in texts):
            raise ValueError('expected a notification')
        values = dict(kept)
        values['at'], values['over'] = float(kept['at']), bool(kept['over'])
        values['event'] = dict(kept.get('event', {}))
        values['pictures'] = tuple(str(each) for each in kept['pictures'])
        return cls(**values)


def notification_of(
    call: IncidentCall, robot: str, at: float, evidence: Path | None = None
) -> Notification:
    """Return the notification of a call.

    Args:
        call: What the book of incidents says.
        robot: Whose mission it is.
        at: Now, seconds since 1970.
        evidence: The observer's folder of pictures; None: there is none.
    """
    told = call.incident.told
    pictures: tuple[str, ...] = ()
    if evidence is not None:
        pictures = tuple(str(evidence / Path(name).name) for name in told.evidence)
    only = '' if call.only is None else f'{call.only:g}'
    named = told.node, *told.cause, told.text, str(call.number), str(call.over), only
    # Of the same hour: what is started again tells of what it finds again.
    key = hashlib.sha256('\n'.join((robot, *named, f'{at // 3600:.0f}')).encode()).hexdigest()[:24]
    return Notification(
        key,
        call.text,
        told.cause.kind,
        told.cause.name,
        told.node,
        robot,
        call.over,
        at,
        _event(told),
        pictures,
        told.action,
    )


def _event(told: IncidentUpdate) -> dict[str, Any]:
    """Return what the observer saw, as sinks tell it; empty where it is of something else."""
    seen = told.finding
    if seen is None:
        return {}
    return {
        'number': seen.number,
        'kind': seen.kind,
        'seen': seen.seen,
        'subject': seen.subject,
        'place': told.place,
        'position': None if seen.position is None else list(seen.position),
        'confidence': seen.confidence,
        'rule': seen.rule,
        'evidence': list(told.evidence),
    }


def as_base64(picture: bytes) -> str:
    """Return bytes as JSON can carry them."""
    return base64.b64encode(picture).decode()
