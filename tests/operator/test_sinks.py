"""People are told by webhook, MQTT, e-mail and command: against real servers."""

from __future__ import annotations

import base64
import json
import logging
import os
import shlex
import shutil
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from strict_files.files import FileError
from surveillance_operator.notify import sinks
from surveillance_operator.notify.outbox import DeliveryError
from surveillance_operator.notify.sinks import SINKS, read_notify_file, sink_from, sink_of
from tests.operator.notify_peers import SECRET, Hook, evidence, news
from tests.operator.ports import await_listening, free_port


@pytest.fixture
def hook() -> Iterator[Hook]:
    server = Hook()
    yield server
    server.server.shutdown()
    server.server.server_close()


def test_a_webhook_gets_json_with_a_token_and_pictures(
    hook: Hook, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('HOOK_TOKEN', SECRET)
    deliver = sink_of(sink_from('a', {'webhook': hook.address, 'token_env': 'HOOK_TOKEN'}))
    shown = evidence(tmp_path, '3_0000001000000_sweep-door-D1-ajar.jpg')
    deliver(news(event={'place': 'C1'}, pictures=(str(shown), str(tmp_path / 'gone.jpg'))))
    ((headers, body),) = hook.posts
    assert headers['Authorization'] == f'Bearer {SECRET}'
    assert headers['Idempotency-Key'] == body['key'] == 'k1'
    assert (body['text'], body['event']) == ('3: door D1 is ajar in C1', {'place': 'C1'})
    (picture,) = body['pictures']
    data = np.frombuffer(base64.b64decode(picture['jpeg']), np.uint8)
    assert cv2.imdecode(data, cv2.IMREAD_COLOR).shape == (120, 160, 3)


@pytest.mark.parametrize(
    ('status', 'final'), [(500, False), (503, False), (401, False), (400, True), (302, False)]
)
def test_a_webhook_that_does_not_take_it_says_so_and_is_not_followed(
    hook: Hook, status: int, final: bool
) -> None:
    hook.answers = [status]
    with pytest.raises(DeliveryError, match=f'answered {status}') as caught:
        sink_of(sink_from('a', {'webhook': hook.address}))(news())
    assert caught.value.final == final
    assert len(hook.posts) == 1


def test_nobody_there_is_one_line_without_the_address(tmp_path: Path) -> None:
    (tmp_path / 'url').write_text(f'http://127.0.0.1:{free_port()}/{SECRET}')
    deliver = sink_of(sink_from('a', {'webhook_file': str(tmp_path / 'url')}))
    with pytest.raises(DeliveryError, match='Connection refused') as caught:
        deliver(news())
    assert SECRET not in str(caught.value)


def test_an_email_has_text_picture_and_an_identity(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    smtp = pytest.importorskip('aiosmtpd.controller')
    received: list[Any] = []

    class Keep:
        async def handle_DATA(  # noqa: N802
            self, _server: Any, _session: Any, envelope: Any
        ) -> str:
            received.append(envelope)
            return '250 kept'

    controller = smtp.Controller(Keep(), hostname='127.0.0.1', port=free_port(), ready_timeout=60.0)
    controller.start()
    try:
        settings = sink_from(
            'guard',
            {
                'email': ['guard@example.org', 'office@example.org'],
                'from': 'robot@example.org',
                'smtp': f'smtp://127.0.0.1:{controller.port}',
            },
        )
        shown = evidence(tmp_path, '3_0000001000000_sweep-door-D1-ajar.jpg')
        sink_of(settings)(news(pictures=(str(shown),)))
    finally:
        controller.stop()
    (envelope,) = received
    assert envelope.rcpt_tos == ['guard@example.org', 'office@example.org']
    text = envelope.content.decode()
    assert 'Subject: Robot1: alarm: event 3' in text
    assert '3: door D1 is ajar in C1' in text
    assert 'Message-ID: <k1@example.org>' in text
    assert 'sweep-door-D1-ajar.jpg' in text


@pytest.mark.filterwarnings('ignore:Requiring AUTH')  # the server's own advice
def test_an_email_that_the_server_refuses_says_why_without_the_password(
    tmp_path: Path,
) -> None:
    smtp = pytest.importorskip('aiosmtpd.controller')
    aiosmtpd = pytest.importorskip('aiosmtpd.smtp')
    (tmp_path / 'password').write_text(SECRET)

    def refuse(*_: Any) -> Any:
        return aiosmtpd.AuthResult(success=False, handled=False)

    controller = smtp.Controller(
        object(),
        hostname='127.0.0.1',
        port=free_port(),
        ready_timeout=60.0,
        authenticator=refuse,
        auth_require_tls=False,
        auth_required=True,
    )
    logging.getLogger('mail.log').setLevel(logging.CRITICAL)
    controller.start()
    try:
        settings = sink_from(
            'guard',
            {
                'email': 'guard@example.org',
                'from': 'robot@example.org',
                'smtp': f'smtp://127.0.0.1:{controller.port}',
                'user': 'robot',
                'password_file': str(tmp_path / 'password'),
            },
        )
        with pytest.raises(DeliveryError, match='answered 535') as caught:
            sink_of(settings)(news())
    finally:
        controller.stop()
    assert SECRET not in str(caught.value)


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[tuple[int, Path]]:
    """Start mosquitto with one user, whose password is asked for."""
    mosquitto = shutil.which('mosquitto', path=f'{os.environ["PATH"]}:/usr/sbin')
    if mosquitto is None:
        pytest.skip('no mosquitto')
    pytest.importorskip('paho.mqtt.client')
    port = free_port()
    (tmp_path / 'users').write_text(f'robot:{SECRET}\n')
    subprocess.run(['mosquitto_passwd', '-U', str(tmp_path / 'users')], check=True)
    (tmp_path / 'users').chmod(0o644)
    (tmp_path / 'conf').write_text(
        f'listener {port} 127.0.0.1\nallow_anonymous false\npassword_file {tmp_path}/users\n'
        'user root\n'
    )
    process = subprocess.Popen(
        [mosquitto, '-c', str(tmp_path / 'conf')],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    await_listening(port, process)
    yield port, tmp_path
    process.terminate()
    process.wait()


def test_a_broker_hands_on_what_is_published_and_refuses_a_wrong_password(
    broker: tuple[int, Path],
) -> None:
    from paho.mqtt import client as mqtt

    port, folder = broker
    (folder / 'password').write_text(SECRET)
    (folder / 'wrong').write_text('wrong')
    came, ready = threading.Event(), threading.Event()
    messages: list[Any] = []
    listener = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    listener.username_pw_set('robot', SECRET)
    listener.on_subscribe = lambda *_: ready.set()
    listener.on_connect = lambda client, *_: client.subscribe('patrol/#', qos=1)

    def keep(_client: Any, _data: Any, message: Any) -> None:
        messages.append(message)
        came.set()

    listener.on_message = keep
    listener.connect('127.0.0.1', port)
    listener.loop_start()
    assert ready.wait(60.0)
    entry = {'mqtt': f'mqtt://127.0.0.1:{port}', 'topic': 'patrol/incidents', 'user': 'robot'}
    sink_of(sink_from('b', {**entry, 'password_file': str(folder / 'password')}))(news())
    assert came.wait(60.0)
    listener.disconnect()
    listener.loop_stop()
    assert json.loads(messages[0].payload)['text'] == '3: door D1 is ajar in C1'
    with pytest.raises(DeliveryError) as caught:
        sink_of(sink_from('b', {**entry, 'password_file': str(folder / 'wrong')}))(news())
    assert 'wrong' not in str(caught.value)


def test_without_the_package_mqtt_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sinks, 'mqtt', None)
    settings = sink_from('b', {'mqtt': 'mqtt://localhost', 'topic': 'patrol'})
    with pytest.raises(ValueError, match='expected the package paho-mqtt'):
        sink_of(settings)


def test_a_command_gets_the_line_and_the_json(tmp_path: Path) -> None:
    script = tmp_path / 'tell'
    script.write_text(f"#!/bin/sh\necho \"$1\" > '{tmp_path}/line'\ncat > '{tmp_path}/json'\n")
    script.chmod(0o755)
    sink_of(sink_from('c', {'command': shlex.quote(str(script))}))(news())
    assert (tmp_path / 'line').read_text() == '3: door D1 is ajar in C1\n'
    assert json.loads((tmp_path / 'json').read_text())['key'] == 'k1'


@pytest.mark.parametrize('poison', ['a\nb', 'a\u2028b', 'a\ud800b'])
def test_a_text_that_no_mail_can_hold_goes_out_in_one_line(
    poison: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[Any] = []

    class Server:
        def __init__(self, *_: Any, **__: Any) -> None:
            pass

        def __enter__(self) -> Server:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def ehlo(self) -> None:
            pass

        def has_extn(self, _: str) -> bool:
            return False

        def send_message(self, message: Any) -> None:
            sent.append(bytes(message))

    monkeypatch.setattr(sinks.smtplib, 'SMTP', Server)
    entry = {'email': 'a@example.org', 'from': 'r@example.org', 'smtp': 'smtp://localhost'}
    sink_of(sink_from('a', entry))(news(name=poison, text=poison, robot=poison))
    (message,) = sent
    assert message.count(b'Subject:') == 1


@pytest.mark.parametrize('kind', SINKS)
def test_each_kind_of_sink_is_in_the_documents(kind: str) -> None:
    """A new kind is an entry of the table, and a row of the page that users read."""
    text = (Path(__file__).parents[2] / 'docs' / 'how-to' / 'notify.md').read_text('utf-8')
    assert f'| {kind} |' in text
    assert all(key in text for key in SINKS[kind].keys if not key.endswith(('_env', '_file')))


# --- the file ---


def test_a_file_names_the_sinks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('T', SECRET)
    (tmp_path / 'notify.yaml').write_text(
        'sinks:\n  office: {webhook: "https://example.org/h", token_env: T, pictures: none}\n'
        '  guard: {email: a@example.org, from: r@example.org, smtp: "smtps://mail.example.org"}\n'
    )
    office, guard = read_notify_file(tmp_path / 'notify.yaml')
    assert (office.name, office.kind, office.pictures) == ('office', 'webhook', 'none')
    assert guard.receivers == ('a@example.org',)
    assert SECRET not in repr(office)


@pytest.mark.parametrize(
    ('entry', 'message'),
    [
        ({'webhok': 'x'}, f'expected one of {", ".join(SINKS)}, got 0'),
        ({'webhook': 'ftp://x'}, "webhook: expected such as 'https://example.org'"),
        ({'webhook': 'https://u:hunter@x'}, 'webhook: a secret must not stand here'),
        ({'webhook': 'https://x', 'token': 'hunter'}, 'expected token_file or token_env'),
        ({'webhook': 'https://x', 'token_env': 'NOT_SET'}, 'variable NOT_SET is not set'),
        ({'webhook': 'https://x', 'token_file': '/nowhere'}, '/nowhere: No such file'),
        ({'webhook': 'https://x', 'topic': 'a'}, 'sinks.a.topic: unknown key, expected'),
        ({'mqtt': 'mqtt://x', 'topic': 'a/#'}, "topic: got 'a/#', expected"),
        ({'mqtt': 'mqtt://x', 'topic': 'a', 'user': 'u'}, "expected 'user' and 'password_file'"),
        ({'email': 'nobody', 'from': 'a@b', 'smtp': 'smtp://x'}, "email: got 'nobody', expected"),
        ({'command': '/nowhere/x'}, "command: '/nowhere/x' cannot be run"),
        (
            {'webhook': 'https://x', 'pictures': 'blured'},
            "pictures: got 'blured', expected 'blurred'",
        ),
        ('text', "expected a mapping such as 'webhook: https://...'"),
    ],
)
def test_a_mistake_is_one_line_with_file_and_line(tmp_path: Path, entry: Any, message: str) -> None:
    (tmp_path / 'notify.yaml').write_text(f'sinks:\n  a: {json.dumps(entry)}\n')
    with pytest.raises(FileError) as caught:
        read_notify_file(tmp_path / 'notify.yaml')
    assert message in str(caught.value)
    assert 'notify.yaml:2: sinks.a' in str(caught.value)
    assert 'hunter' not in str(caught.value)
