"""News: one call for an incident, as it goes to people and programs."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from surveillance_runtime.incidents import Call


@dataclass(frozen=True)
class News:
    """One call for an incident.

    Attributes:
        key: The same for the same call, also when it is sent twice.
        text: One sentence.
        kind, name: What it is about, as `incidents.Cause`.
        node: Who tells of it.
        robot: Whose mission it is.
        over: Whether it is over.
        at: When, seconds since 1970.
        event: Of the observer, as `Event.to_json`; empty where it is none.
        pictures: Files that show it, the first and the last sighting.
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

    @property
    def subject(self) -> str:
        """Return a short line."""
        word = 'all clear' if self.over else 'alarm'
        return f'{self.robot}: {word}: {self.kind} {self.name}'

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
        }

    def kept(self) -> str:
        """Return it as the outbox keeps it, see `from_kept`."""
        return json.dumps({**self.to_json(), 'pictures': list(self.pictures)})

    @classmethod
    def from_kept(cls, text: str) -> News:
        """Return what `kept` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        values = json.loads(text)
        values['pictures'] = tuple(str(each) for each in values['pictures'])
        return cls(**values)


def news_of(call: Call, robot: str, at: float, evidence: Path | None = None) -> News:
    """Return the news of a call.

    Args:
        call: What the book of incidents says.
        robot: Whose mission it is.
        at: Now, seconds since 1970.
        evidence: The observer's folder of pictures; None: there is none.
    """
    incident = call.incident
    event = _event(evidence, incident.cause.name) if incident.cause.kind == 'event' else {}
    pictures: tuple[str, ...] = ()
    if evidence is not None:
        pictures = tuple(str(evidence / Path(str(name)).name) for name in event.get('evidence', ()))
    named = incident.node, *incident.cause, incident.text, str(call.number), str(call.over)
    # Of the same hour: a launcher that is started again tells of what it finds again.
    key = hashlib.sha256('\n'.join((robot, *named, f'{at // 3600:.0f}')).encode()).hexdigest()[:24]
    return News(
        key,
        call.text,
        incident.cause.kind,
        incident.cause.name,
        incident.node,
        robot,
        call.over,
        at,
        event,
        pictures,
    )


def _event(evidence: Path | None, number: str) -> dict[str, Any]:
    if evidence is None or not number.isdigit():
        return {}
    try:
        event = json.loads((evidence / f'event_{number}.json').read_text('utf-8'))
    except (OSError, ValueError):
        return {}  # the alarm counts without it
    return event if isinstance(event, dict) else {}


def as_base64(picture: bytes) -> str:
    """Return bytes as JSON can carry them."""
    return base64.b64encode(picture).decode()
