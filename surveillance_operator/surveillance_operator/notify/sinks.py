"""Sinks: who is told. Each takes news or raises `DeliveryError`, with one line without secrets."""

from __future__ import annotations

import importlib
import json
import shlex
import smtplib
import ssl
import subprocess
import urllib.error
import urllib.request
from collections.abc import Callable
from email.message import EmailMessage
from email.utils import formatdate
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from surveillance_operator.notify.news import News, as_base64
from surveillance_operator.notify.outbox import Deliver, DeliveryError
from surveillance_operator.notify.settings import Secret, SinkSettings

TIMEOUT = 10.0
"""For one try, seconds."""
COMMAND_TIMEOUT = 60.0

mqtt: Any
try:
    mqtt = importlib.import_module('paho.mqtt.client')
except ImportError:
    mqtt = None


def sink_of(settings: SinkSettings) -> Deliver:
    """Return what hands news to the sink that the settings describe.

    Raises:
        ValueError: It needs a package that is not installed.
    """
    if settings.kind == 'mqtt' and mqtt is None:
        raise ValueError(
            'mqtt: expected the package paho-mqtt (pip install "surveillance[notify]")'
        )
    kinds: dict[str, Callable[[SinkSettings, News], None]] = {
        'webhook': _post,
        'mqtt': _publish,
        'email': _mail,
        'command': _run,
    }
    deliver = kinds[settings.kind]
    return lambda news: deliver(settings, news)


def pictures_of(settings: SinkSettings, news: News) -> list[tuple[str, bytes]]:
    """Return the pictures that may leave the machine: name and JPEG each."""
    if settings.pictures == 'none':
        return []
    if not news.pictures:
        return []
    # It takes its time, and most news have no picture.
    from indoor_watch.privacy import PictureError, shareable

    found = []
    for path in dict.fromkeys(news.pictures):
        try:
            found.append(
                (Path(path).name, shareable(Path(path), blur=settings.pictures != 'sharp'))
            )
        except PictureError:
            continue  # deleted meanwhile, or none: the news count without it
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


def _post(settings: SinkSettings, news: News) -> None:
    address = settings.address or _secret(settings.address_secret)
    body = news.to_json()
    body['pictures'] = [
        {'name': name, 'jpeg': as_base64(data)} for name, data in pictures_of(settings, news)
    ]
    request = urllib.request.Request(
        address,
        json.dumps(body).encode(),
        {'Content-Type': 'application/json', 'Idempotency-Key': news.key},
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


def _publish(settings: SinkSettings, news: News) -> None:
    where = urlsplit(settings.address)
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id=f'patrol-{news.key[:12]}')
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
        told = client.publish(settings.topic, json.dumps(news.to_json()), qos=1)
        told.wait_for_publish(TIMEOUT)
        if not told.is_published():
            raise DeliveryError(refused[0] if refused else 'the broker did not take it')
    except (OSError, ValueError, RuntimeError) as error:
        raise DeliveryError(_why(error)) from None
    finally:
        client.disconnect()
        client.loop_stop()


def _mail(settings: SinkSettings, news: News) -> None:
    where = urlsplit(settings.address)
    host, is_tls = where.hostname or '', where.scheme == 'smtps'
    message = EmailMessage()
    message['From'], message['To'] = settings.sender, ', '.join(settings.receivers)
    message['Subject'] = news.subject
    message['Date'] = formatdate(news.at)
    message['Message-ID'] = f'<{news.key}@{settings.sender.rpartition("@")[2]}>'
    lines = [news.text, '', f'robot: {news.robot}', f'told by: {news.node}']
    if news.event:
        lines += [f'{key}: {news.event[key]}' for key in ('place', 'rule') if news.event.get(key)]
    message.set_content('\n'.join(lines) + '\n')
    for name, data in pictures_of(settings, news):
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


def _run(settings: SinkSettings, news: News) -> None:
    try:
        done = subprocess.run(
            [*shlex.split(settings.address), news.text],
            input=json.dumps(news.to_json()).encode(),
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
