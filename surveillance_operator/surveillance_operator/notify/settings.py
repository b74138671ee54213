"""Who is to be told, as `notify.yaml` says it.

    sinks:
      office: {webhook: https://example.org/hook, token_env: OFFICE_TOKEN}
      house: {mqtt: mqtt://localhost:1883, topic: patrol/incidents}
      guard: {email: guard@example.org, from: robot@example.org, smtp: smtps://mail.example.org,
              user: robot, password_file: /etc/patrol/mail}
      lamp: {command: /usr/local/bin/blink, pictures: none}

Secrets are never in it: a file or an environment variable holds them, and is read for each try.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from strict_files.suggestions import nearest
from strict_files.yaml_file import EntryError, read_table

PICTURES = ('blurred', 'sharp', 'none')
_SCHEMES = {
    'webhook': ('https', 'http'),
    'mqtt': ('mqtt', 'mqtts'),
    'smtp': ('smtp', 'smtps'),
}
_SECRETS = {'webhook': 'token', 'mqtt': 'password', 'email': 'password'}
_KEYS = {
    'webhook': ('webhook', 'webhook_env', 'webhook_file', 'token_env', 'token_file'),
    'mqtt': ('mqtt', 'topic', 'user', 'password_env', 'password_file'),
    'email': ('email', 'from', 'smtp', 'user', 'password_env', 'password_file'),
    'command': ('command',),
}
_NAME = re.compile(r'[A-Za-z0-9][A-Za-z0-9_-]{0,39}\Z')
_MAIL = re.compile(r'[^@\s,<>]+@[^@\s,<>]+\Z')


@dataclass(frozen=True)
class Secret:
    """Where a secret is: an environment variable or a file.

    Attributes:
        variable, file: One of them; the other is empty.
    """

    variable: str = ''
    file: str = ''

    def read(self) -> str:
        """Return it.

        Raises:
            ValueError: It is not there; one line that does not hold it.
        """
        if self.variable:
            value = os.environ.get(self.variable, '')
            if not value:
                raise ValueError(f'the environment variable {self.variable} is not set')
            return value
        try:
            value = Path(self.file).read_text('utf-8').strip()
        except (OSError, UnicodeDecodeError) as error:
            raise ValueError(f'{self.file}: {getattr(error, "strerror", "no text")}') from None
        if not value:
            raise ValueError(f'{self.file}: is empty')
        return value


@dataclass(frozen=True)
class SinkSettings:
    """One sink.

    Attributes:
        name: Of the user's choice.
        kind: webhook, mqtt, email or command.
        address: URL, of e-mail that of the server; or the command.
        address_secret: Where the address is when it is a secret itself.
        secret: Token or password.
        user: Who logs in.
        topic: Of MQTT.
        sender, receivers: Of e-mail.
        pictures: blurred: what shows a person or face is blurred; sharp; none.
    """

    name: str
    kind: str
    address: str = ''
    address_secret: Secret | None = None
    secret: Secret | None = None
    user: str = ''
    topic: str = ''
    sender: str = ''
    receivers: tuple[str, ...] = ()
    pictures: str = 'blurred'


def read_notify_file(path: str | Path) -> list[SinkSettings]:
    """Return the sinks of a file.

    Raises:
        FileError: One line with file, line, what was wrong and what was expected.
    """
    return read_table(path, 'sinks', "'webhook: https://...'", sink_from)


def sink_from(name: str, entry: Mapping[str, Any]) -> SinkSettings:
    """Return the sink that a mapping describes.

    Raises:
        ValueError: What was wrong, and what was expected.
    """
    if not _NAME.match(name):
        raise ValueError('expected a name of letters, digits, - and _')
    stems = {key.split('_')[0] for key in entry}
    kinds = [kind for kind in _KEYS if kind in stems]
    if len(kinds) != 1:
        raise ValueError(f'expected one of {", ".join(_KEYS)}, got {len(kinds)} of them')
    kind = kinds[0]
    allowed = (*_KEYS[kind], 'pictures')
    for key in entry:
        if key in ('password', 'token'):
            raise EntryError(key, f'a secret must not stand here, expected {key}_file or {key}_env')
        if key not in allowed:
            raise EntryError(key, f'unknown key, expected {nearest(key, allowed)}')
    pictures = str(entry.get('pictures', 'blurred'))
    if pictures not in PICTURES:
        raise ValueError(f'pictures: got {pictures!r}, expected {nearest(pictures, PICTURES)}')
    secret = _secret(entry, _SECRETS[kind]) if kind in _SECRETS else None
    user = str(entry.get('user', ''))
    if kind in ('mqtt', 'email') and bool(user) != (secret is not None):
        raise ValueError("expected 'user' and 'password_file' or 'password_env' together")
    if kind == 'webhook':
        hidden = _secret(entry, 'webhook')
        if (hidden is None) != ('webhook' in entry):
            raise ValueError("expected one of 'webhook', 'webhook_file' and 'webhook_env'")
        address = '' if hidden is not None else _address('webhook', entry['webhook'])
        return SinkSettings(name, kind, address, hidden, secret, pictures=pictures)
    if kind == 'mqtt':
        topic = str(entry.get('topic', ''))
        if not topic or any(each in topic for each in '+#\0'):
            raise ValueError(f"topic: got {topic!r}, expected one such as 'patrol/incidents'")
        address = _address('mqtt', entry['mqtt'])
        return SinkSettings(
            name, kind, address, secret=secret, user=user, topic=topic, pictures=pictures
        )
    if kind == 'email':
        given = entry['email']
        receivers = tuple(map(str, given if isinstance(given, list) else [given]))
        sender = str(entry.get('from', ''))
        for key, address in (*(('email', each) for each in receivers), ('from', sender)):
            if not _MAIL.match(address):
                raise ValueError(f"{key}: got {address!r}, expected such as 'guard@example.org'")
        server = _address('smtp', entry.get('smtp', ''))
        return SinkSettings(
            name,
            kind,
            server,
            secret=secret,
            user=user,
            sender=sender,
            receivers=receivers,
            pictures=pictures,
        )
    return SinkSettings(name, kind, _command(entry['command']), pictures=pictures)


def _command(value: Any) -> str:
    try:
        words = shlex.split(str(value))
    except ValueError as error:
        raise ValueError(f'command: {error}') from None
    if not words or shutil.which(words[0]) is None:
        raise ValueError(f'command: {words[0] if words else ""!r} cannot be run')
    return str(value)


def _secret(entry: Mapping[str, Any], stem: str) -> Secret | None:
    given = [key for key in (f'{stem}_env', f'{stem}_file') if key in entry]
    if len(given) > 1:
        raise ValueError(f"expected one of '{given[0]}' and '{given[1]}'")
    if not given:
        return None
    value = str(entry[given[0]])
    secret = Secret(variable=value) if given[0].endswith('_env') else Secret(file=value)
    secret.read()  # a mistake shows before a process is started
    return secret


def _address(key: str, value: Any) -> str:
    """Return a URL; what it may hold of a secret is in no message."""
    schemes = _SCHEMES[key]
    try:
        parts = urlsplit(str(value))
        sound = parts.scheme in schemes and parts.hostname and (parts.port or 1)
    except ValueError:
        sound, parts = None, urlsplit('')
    if not sound:
        raise ValueError(f"{key}: expected such as '{schemes[0]}://example.org'")
    if parts.username or parts.password:
        raise ValueError(f'{key}: a secret must not stand here, expected an address without one')
    return str(value)
