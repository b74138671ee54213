"""Sinks: who is told, as `notify.yaml` says it.

    sinks:
      office: {webhook: https://example.org/hook, token_env: OFFICE_TOKEN}
      house: {mqtt: mqtt://localhost:1883, topic: patrol/incidents}
      guard: {email: guard@example.org, from: robot@example.org, smtp: smtps://mail.example.org,
              user: robot, password_file: /etc/patrol/mail}
      lamp: {command: /usr/local/bin/blink, pictures: none}
      boss: {email: boss@example.org, ..., kinds: [person], hours: daily 20:00-06:00, after: 10 min}

Each is told of alarms. `severity: warning` tells of warnings, too; `kinds`, `hours` and `after` say
of what, when, and that nobody has acknowledged it for so long.

Secrets are never in it: a file or an environment variable holds them, and is read for each try.

Each takes a notification or raises `DeliveryError`, without secrets in it. :data:`SINKS` has every
kind: its keys in the file, how they are read, and how it is told. A new one is an entry there, and
a row in `docs/how-to/notify.md`.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import shlex
import shutil
import smtplib
import ssl
import subprocess
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from email.message import EmailMessage
from email.utils import formatdate
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from patrol_policy.hours import WeeklyHours
from strict_files.one_line import clean
from strict_files.suggestions import nearest
from strict_files.yaml_file import EntryError, read_table
from surveillance_operator.desk.handling import kinds_of
from surveillance_operator.notify.home_assistant import Discovery
from surveillance_operator.notify.notification import Notification, as_base64
from surveillance_operator.notify.outbox import Deliver, DeliveryError
from surveillance_runtime.incidents import IncidentCall, Severity

PICTURES = ('blurred', 'sharp', 'none')


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
class Takes:
    """Of what a sink is told.

    Attributes:
        severity: The least.
        kinds: Of the cause, or of what was seen; empty: all.
        hours: When; None: always.
        after: For how long nobody has acknowledged it, seconds.
    """

    severity: Severity = Severity.ALARM
    kinds: tuple[str, ...] = ()
    hours: WeeklyHours | None = None
    after: float = 0.0

    def takes(self, call: IncidentCall, at: float) -> bool:
        """Tell whether a call at a time, seconds since 1970, is for it."""
        told = call.incident.told
        if self.severity is Severity.ALARM and not call.number:
            return False
        if self.kinds and not set(self.kinds).intersection(kinds_of(told)):
            return False
        if call.only is not None and self.after != call.only:
            return False
        if self.after > call.reached:
            return False
        return self.hours is None or self.hours.at(datetime.fromtimestamp(at)) == 'must'


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
        discovery: Tells Home Assistant; None: it is not told.
        sender, receivers: Of e-mail.
        pictures: blurred: what shows a person or face is blurred; sharp; none.
        takes: Of what it is told.
    """

    name: str
    kind: str
    address: str = ''
    address_secret: Secret | None = None
    secret: Secret | None = None
    user: str = ''
    topic: str = ''
    discovery: Discovery | None = None
    sender: str = ''
    receivers: tuple[str, ...] = ()
    pictures: str = 'blurred'
    takes: Takes = Takes()


TIMEOUT = 10.0
"""For one try, seconds."""
COMMAND_TIMEOUT = 60.0

mqtt: Any
try:
    mqtt = importlib.import_module('paho.mqtt.client')
except ImportError:
    mqtt = None


def pictures_of(settings: SinkSettings, notification: Notification) -> list[tuple[str, bytes]]:
    """Return the pictures that may leave the machine: name and JPEG each."""
    if settings.pictures == 'none':
        return []
    if not notification.pictures:
        return []
    # It takes its time, and most have no picture.
    from indoor_watch.privacy import PictureError, shareable

    found = []
    for path in dict.fromkeys(notification.pictures):
        try:
            found.append(
                (Path(path).name, shareable(Path(path), blur=settings.pictures != 'sharp'))
            )
        except PictureError:
            continue  # deleted meanwhile, or none: it counts without
    return found


def _secret(secret: Secret | None) -> str:
    try:
        return '' if secret is None else secret.read()
    except ValueError as error:
        raise DeliveryError(str(error)) from None


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """The token is for the address that the person wrote, and for no other one."""

    def redirect_request(self, *_: object) -> None:
        return None


def _post(settings: SinkSettings, notification: Notification) -> None:
    address = settings.address or _secret(settings.address_secret)
    body = notification.to_json()
    body['pictures'] = [
        {'name': name, 'jpeg': as_base64(data)}
        for name, data in pictures_of(settings, notification)
    ]
    request = urllib.request.Request(
        address,
        json.dumps(body).encode(),
        {'Content-Type': 'application/json', 'Idempotency-Key': notification.key},
        method='POST',
    )
    if settings.secret is not None:
        request.add_header('Authorization', f'Bearer {_secret(settings.secret)}')
    opener = urllib.request.build_opener(_NoRedirect)
    try:
        with opener.open(request, timeout=TIMEOUT) as answer:
            answer.read(1000)
    except urllib.error.HTTPError as error:
        # What the other side calls our mistake stays one; too many requests and time-outs pass.
        final = 400 <= error.code < 500 and error.code not in (401, 403, 404, 408, 425, 429)
        raise DeliveryError(f'answered {error.code}', final=final) from None
    except (OSError, ValueError) as error:
        raise DeliveryError(_why(error)) from None


def _publish(settings: SinkSettings, notification: Notification) -> None:
    where = urlsplit(settings.address)
    client = mqtt.Client(
        mqtt.CallbackAPIVersion.VERSION2, client_id=f'patrol-{notification.key[:12]}'
    )
    if settings.user:
        client.username_pw_set(settings.user, _secret(settings.secret))
    if where.scheme == 'mqtts':
        client.tls_set()
    client.connect_timeout = TIMEOUT
    refused: list[str] = []

    def on_connect(_c: object, _u: object, _f: object, reason: object, _p: object) -> None:
        if getattr(reason, 'is_failure', False):
            refused.append(str(reason))

    client.on_connect = on_connect
    try:
        client.connect(where.hostname or '', where.port or (8883 if client._ssl else 1883))
        client.loop_start()
        told = client.publish(settings.topic, json.dumps(notification.to_json()), qos=1)
        told.wait_for_publish(TIMEOUT)
        if not told.is_published():
            raise DeliveryError(refused[0] if refused else 'the broker did not take it')
        found = () if settings.discovery is None else settings.discovery.messages(notification)
        for topic, payload in found:
            client.publish(topic, payload, qos=1, retain=True).wait_for_publish(TIMEOUT)
    except (OSError, ValueError, RuntimeError) as error:
        raise DeliveryError(_why(error)) from None
    finally:
        client.disconnect()
        client.loop_stop()


def _mail(settings: SinkSettings, notification: Notification) -> None:
    where = urlsplit(settings.address)
    host, is_tls = where.hostname or '', where.scheme == 'smtps'
    message = EmailMessage()
    message['From'], message['To'] = settings.sender, ', '.join(settings.receivers)
    message['Subject'] = clean(notification.subject)
    message['Date'] = formatdate(notification.at)
    message['Message-ID'] = f'<{notification.key}@{settings.sender.rpartition("@")[2]}>'
    lines = [clean(notification.text), '']
    lines += [f'to do: {clean(notification.action)}'] if notification.action else []
    lines += [f'robot: {clean(notification.robot)}', f'told by: {clean(notification.node)}']
    if notification.event:
        lines += [
            f'{key}: {clean(str(notification.event[key]))}'
            for key in ('place', 'rule')
            if notification.event.get(key)
        ]
    message.set_content('\n'.join(lines) + '\n')
    for name, data in pictures_of(settings, notification):
        message.add_attachment(data, maintype='image', subtype='jpeg', filename=name)
    port = where.port or (465 if is_tls else 587)
    context = ssl.create_default_context()
    try:
        with (
            smtplib.SMTP_SSL(host, port, timeout=TIMEOUT, context=context)
            if is_tls
            else smtplib.SMTP(host, port, timeout=TIMEOUT)
        ) as server:
            server.ehlo()
            if not is_tls and server.has_extn('starttls'):
                server.starttls(context=context)
                server.ehlo()
            elif not is_tls and settings.user and host not in ('localhost', '127.0.0.1', '::1'):
                raise DeliveryError('the server offers no TLS: the password is not sent')
            if settings.user:
                server.login(settings.user, _secret(settings.secret))
            server.send_message(message)
    except smtplib.SMTPResponseException as error:
        final = error.smtp_code in (550, 552, 553, 554)
        raise DeliveryError(f'answered {error.smtp_code}', final=final) from None
    except smtplib.SMTPException as error:
        raise DeliveryError(type(error).__name__) from None
    except OSError as error:
        raise DeliveryError(_why(error)) from None


def _run(settings: SinkSettings, notification: Notification) -> None:
    try:
        done = subprocess.run(
            [*shlex.split(settings.address), clean(notification.text)],
            input=json.dumps(notification.to_json()).encode(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=COMMAND_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise DeliveryError(f'took longer than {COMMAND_TIMEOUT:g} s') from None
    except (OSError, ValueError) as error:
        raise DeliveryError(_why(error), final=True) from None
    if done.returncode:
        raise DeliveryError(f'ended with {done.returncode}')


def _why(error: BaseException) -> str:
    """Return what went wrong without the address, which may hold a secret."""
    reason = getattr(error, 'reason', None)
    cause = reason if isinstance(reason, OSError) else error
    if isinstance(cause, TimeoutError):
        return 'no answer in time'
    return getattr(cause, 'strerror', None) or type(cause).__name__


# --- what notify.yaml says of each ---


def secret_in(entry: Mapping[str, Any], stem: str) -> Secret | None:
    """Return where a secret is, whose keys begin with a stem; None: none is given.

    Raises:
        ValueError: It is given twice, or is not there.
    """
    given = [key for key in (f'{stem}_env', f'{stem}_file') if key in entry]
    if len(given) > 1:
        raise ValueError(f"expected one of '{given[0]}' and '{given[1]}'")
    if not given:
        return None
    value = str(entry[given[0]])
    secret = Secret(variable=value) if given[0].endswith('_env') else Secret(file=value)
    secret.read()  # a mistake shows before a process is started
    return secret


def address_in(key: str, value: Any, schemes: tuple[str, ...]) -> str:
    """Return a URL; what it may hold of a secret is in no message.

    Raises:
        ValueError: It has none of the schemes, or holds a secret.
    """
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


_NAME = re.compile(r'[A-Za-z0-9][A-Za-z0-9_-]{0,39}\Z')
_MAIL = re.compile(r'[^@\s,<>]+@[^@\s,<>]+\Z')
Entry = Mapping[str, Any]


def _webhook_of(settings: SinkSettings, entry: Entry) -> SinkSettings:
    hidden = secret_in(entry, 'webhook')
    if (hidden is None) != ('webhook' in entry):
        raise ValueError("expected one of 'webhook', 'webhook_file' and 'webhook_env'")
    if hidden is not None:
        return replace(settings, address_secret=hidden)
    address = address_in('webhook', entry['webhook'], ('https', 'http'))
    return replace(settings, address=address)


def _mqtt_of(settings: SinkSettings, entry: Entry) -> SinkSettings:
    topic = str(entry.get('topic', ''))
    if not topic or any(each in topic for each in '+#\0'):
        raise ValueError(f"topic: got {topic!r}, expected one such as 'patrol/incidents'")
    address = address_in('mqtt', entry['mqtt'], ('mqtt', 'mqtts'))
    wanted = entry.get('discovery')
    if wanted not in (None, 'homeassistant'):
        raise EntryError('discovery', f"got {wanted!r}, expected 'homeassistant'")
    discovery = None if wanted is None else Discovery(topic)
    return replace(_with_user(settings, entry), address=address, topic=topic, discovery=discovery)


def _mail_of(settings: SinkSettings, entry: Entry) -> SinkSettings:
    given = entry['email']
    receivers = tuple(map(str, given if isinstance(given, list) else [given]))
    sender = str(entry.get('from', ''))
    for key, address in (*(('email', each) for each in receivers), ('from', sender)):
        if not _MAIL.match(address):
            raise ValueError(f"{key}: got {address!r}, expected such as 'guard@example.org'")
    server = address_in('smtp', entry.get('smtp', ''), ('smtp', 'smtps'))
    return replace(_with_user(settings, entry), address=server, sender=sender, receivers=receivers)


def _with_user(settings: SinkSettings, entry: Entry) -> SinkSettings:
    user = str(entry.get('user', ''))
    if bool(user) != (settings.secret is not None):
        raise ValueError("expected 'user' and 'password_file' or 'password_env' together")
    return replace(settings, user=user)


def _command_of(settings: SinkSettings, entry: Entry) -> SinkSettings:
    value = str(entry['command'])
    try:
        words = shlex.split(value)
    except ValueError as error:
        raise ValueError(f'command: {error}') from None
    if not words or shutil.which(words[0]) is None:
        raise ValueError(f'command: {words[0] if words else ""!r} cannot be run')
    return replace(settings, address=value)


def _needs_mqtt() -> str:
    if mqtt is not None:
        return ''
    return 'mqtt: expected the package paho-mqtt (.venv/bin/python -m pip install paho-mqtt)'


@dataclass(frozen=True)
class SinkKind:
    """One kind of sink.

    Attributes:
        keys: Those that an entry of `notify.yaml` may have, beside `pictures`.
        secret: What the keys of its secret begin with; empty: it has none.
        read: Returns the settings with what an entry says; raises `ValueError`.
        deliver: Tells it.
        needs: Returns which package is missing; empty: none.
    """

    keys: tuple[str, ...]
    secret: str
    read: Callable[[SinkSettings, Entry], SinkSettings]
    deliver: Callable[[SinkSettings, Notification], None]
    needs: Callable[[], str] = lambda: ''


SINKS: Mapping[str, SinkKind] = {
    'webhook': SinkKind(
        ('webhook', 'webhook_env', 'webhook_file', 'token_env', 'token_file'),
        'token',
        _webhook_of,
        _post,
    ),
    'mqtt': SinkKind(
        ('mqtt', 'topic', 'discovery', 'user', 'password_env', 'password_file'),
        'password',
        _mqtt_of,
        _publish,
        _needs_mqtt,
    ),
    'email': SinkKind(
        ('email', 'from', 'smtp', 'user', 'password_env', 'password_file'),
        'password',
        _mail_of,
        _mail,
    ),
    'command': SinkKind(('command',), '', _command_of, _run),
}
"""Every kind of sink by the key that an entry of it has."""


def read_notify_file(path: str | Path) -> list[SinkSettings]:
    """Return the sinks of a file.

    Raises:
        FileError: One line with file, line, what was wrong and what was expected.
    """
    return read_table(path, 'sinks', "'webhook: https://...'", sink_from)


def sink_from(name: str, entry: Entry) -> SinkSettings:
    """Return the sink that a mapping describes.

    Raises:
        ValueError: What was wrong, and what was expected.
    """
    if not _NAME.match(name):
        raise ValueError('expected a name of letters, digits, - and _')
    stems = {key.split('_')[0] for key in entry}
    kinds = [kind for kind in SINKS if kind in stems]
    if len(kinds) != 1:
        raise ValueError(f'expected one of {", ".join(SINKS)}, got {len(kinds)} of them')
    kind = SINKS[kinds[0]]
    allowed = (*kind.keys, 'pictures', *FILTERS)
    for key in entry:
        if key in ('password', 'token'):
            raise EntryError(key, f'a secret must not stand here, expected {key}_file or {key}_env')
        if key not in allowed:
            raise EntryError(key, f'unknown key, expected {nearest(key, allowed)}')
    pictures = str(entry.get('pictures', 'blurred'))
    if pictures not in PICTURES:
        raise ValueError(f'pictures: got {pictures!r}, expected {nearest(pictures, PICTURES)}')
    secret = secret_in(entry, kind.secret) if kind.secret else None
    takes = _takes_of(entry)
    return kind.read(
        SinkSettings(name, kinds[0], secret=secret, pictures=pictures, takes=takes), entry
    )


FILTERS = ('severity', 'kinds', 'hours', 'after')
_UNITS = {'s': 1.0, 'min': 60.0, 'h': 3600.0}


def _takes_of(entry: Entry) -> Takes:
    """Return of what a sink is told.

    Raises:
        EntryError: What was wrong, and what was expected.
    """
    severity = str(entry.get('severity', Severity.ALARM))
    if severity not in list(Severity):
        raise EntryError('severity', f'got {severity!r}, expected {nearest(severity, Severity)}')
    kinds = entry.get('kinds', [])
    if not isinstance(kinds, list) or not all(isinstance(each, str) for each in kinds):
        raise EntryError('kinds', f'got {kinds!r}, expected a list such as [person, door]')
    hours, after = None, 0.0
    if 'hours' in entry:
        text = str(entry['hours'])
        try:
            hours = WeeklyHours.parse(f'daily {text}' if re.match(r'\d', text) else text)
        except ValueError as error:
            raise EntryError('hours', str(error)) from None
    if 'after' in entry:
        match = re.fullmatch(r'(\d+(?:\.\d+)?) ?(s|min|h)', str(entry['after']))
        if match is None:
            raise EntryError('after', f"got {entry['after']!r}, expected such as '10 min'")
        after = float(match[1]) * _UNITS[match[2]]
    return Takes(Severity(severity), tuple(kinds), hours, after)


def sink_of(settings: SinkSettings) -> Deliver:
    """Return what hands notifications to the sink that the settings describe.

    Raises:
        ValueError: It needs a package that is not installed.
    """
    kind = SINKS[settings.kind]
    if problem := kind.needs():
        raise ValueError(problem)
    return lambda notification: kind.deliver(settings, notification)
