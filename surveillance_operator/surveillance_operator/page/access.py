"""Who may do what on the page: roles, each by a link of its own that can be taken back.

A **viewer** looks. A **guard** also answers alarms, stops the robot and releases it. An
**operator** does all that the page offers, and makes and takes back the links of others.

The token that the mission prints is an operator's. Each further link has a token of its own; a file
that its owner alone reads (mode 0600) keeps the names, roles and hashes of the tokens, never a
token.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import secrets
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from strict_files.one_line import clean
from strict_files.regular_files import parse_json, read_file
from strict_files.suggestions import nearest

VIEWER, GUARD, OPERATOR = ROLES = ('viewer', 'guard', 'operator')
"""From the one that may least to the one that may most."""
MOST_LINKS = 200
LONGEST_NAME = 60
_LARGEST = 1_000_000
_OF_GUARDS = ('stop', 'alarm', 'event')
_WORDS_OF_GUARDS = ('stop', 'release')


@dataclass(frozen=True)
class PageUser:
    """Who has sent a request.

    Attributes:
        name: Of the link.
        role: One of `ROLES`.
    """

    name: str
    role: str

    def may(self, role: str) -> bool:
        """Tell whether somebody may do what takes at least a role."""
        return ROLES.index(self.role) >= ROLES.index(role)


NOBODY = PageUser('somebody', VIEWER)
"""Who has no token, on this machine."""
HOLDER = PageUser('operator', OPERATOR)
"""Who has the token that the mission prints."""


def least_role(action: str, fields: Mapping[str, Any]) -> str:
    """Return the role that an action takes at least."""
    if action in _OF_GUARDS or (action == 'fleet' and fields.get('word') in _WORDS_OF_GUARDS):
        return GUARD
    return OPERATOR


@dataclass(frozen=True)
class Link:
    """A link that somebody was given.

    Attributes:
        name, role: Whose, and what they may do.
        hash: SHA-256 of its token, hexadecimal.
        made: When, seconds since 1970.
    """

    name: str
    role: str
    hash: str
    made: float


class Links:
    """The links of a page; safe from any thread, and for several pages that share the file.

    Args:
        path: The file that keeps them; None: they are of this process.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._links: tuple[Link, ...] = ()
        self._read_at: tuple[int, int] | None = None

    def person(self, token: str) -> PageUser | None:
        """Return whose token it is; None: nobody's."""
        given = _hash(token)
        for each in self._now():
            if secrets.compare_digest(each.hash, given):
                return PageUser(each.name, each.role)
        return None

    def listed(self) -> list[dict[str, Any]]:
        """Return the links without their tokens."""
        return [{'name': e.name, 'role': e.role, 'made': e.made} for e in self._now()]

    def make(self, name: str, role: str) -> str:
        """Make a link, or a new one in place of that of the same name; return its token.

        Raises:
            ValueError: The name or role is none, or there are too many.
            OSError: It cannot be kept.
        """
        name = clean(str(name)).strip()
        if not 0 < len(name) <= LONGEST_NAME or name == HOLDER.name:
            raise ValueError(f'expected a name of up to {LONGEST_NAME} signs, such as Anna')
        if role not in ROLES:
            raise ValueError(f'{str(role)[:40]!r}: expected {nearest(str(role)[:40], ROLES)}')
        token = secrets.token_urlsafe(24)
        with self._changed() as links:
            links[:] = [each for each in links if each.name != name]
            if len(links) >= MOST_LINKS:
                raise ValueError(f'more than {MOST_LINKS} links: take one back first')
            links.append(Link(name, role, _hash(token), round(time.time(), 1)))
        return token

    def revoke(self, name: str) -> None:
        """Take a link back: who has it may not even look any more.

        Raises:
            ValueError: There is none of that name.
            OSError: It cannot be kept.
        """
        with self._changed() as links:
            left = [each for each in links if each.name != name]
            if len(left) == len(links):
                known = nearest(str(name)[:40], [each.name for each in links])
                raise ValueError(f'no link of {str(name)[:40]!r}: expected {known}')
            links[:] = left

    def _now(self) -> tuple[Link, ...]:
        """Return the links, also those that another process has made or taken back."""
        if self._path is not None:
            try:
                status = os.stat(self._path)
                stamp = status.st_mtime_ns, status.st_ino
                if stamp != self._read_at:
                    self._links, self._read_at = _links_in(self._path), stamp
            except (OSError, ValueError, KeyError, TypeError):
                # What cannot be read lets nobody in.
                self._links, self._read_at = (), None
        return self._links

    @contextlib.contextmanager
    def _changed(self) -> Iterator[list[Link]]:
        if self._path is None:
            links = list(self._links)
            yield links
            self._links = tuple(links)
            return
        self._path.parent.mkdir(parents=True, exist_ok=True)
        lock = os.open(f'{self._path}.lock', os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
            links = list(_kept_in(self._path))
            yield links
            part = f'{self._path}.part'
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW
            with open(os.open(part, flags, 0o600), 'w', encoding='utf-8') as file:
                json.dump([asdict(each) for each in links], file, indent=1)
            os.replace(part, self._path)
        finally:
            os.close(lock)


def _kept_in(path: Path) -> tuple[Link, ...]:
    """Return the links of a file that is written next; one that cannot be read is put aside, as
    `NAME.unread`.

    Raises:
        OSError: It is there and nobody may read it.
    """
    try:
        return _links_in(path)
    except FileNotFoundError:
        return ()
    except (ValueError, KeyError, TypeError):
        os.replace(path, f'{path}.unread')
        return ()


def _links_in(path: Path) -> tuple[Link, ...]:
    """Return the links of a file.

    Raises:
        OSError, ValueError, KeyError, TypeError: It cannot be read.
    """
    values = parse_json(read_file(path, _LARGEST))
    links = tuple(
        Link(str(e['name']), str(e['role']), str(e['hash']), float(e['made'])) for e in values
    )
    if any(each.role not in ROLES for each in links):
        raise ValueError('a role that there is not')
    return links


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()
