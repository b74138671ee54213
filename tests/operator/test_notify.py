"""People are told by webhook, MQTT, e-mail and command: against real servers on the loopback."""

from __future__ import annotations

import base64
import json
import logging
import os
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from launcher.alarm import Alarm
from strict_files.files import FileError
from surveillance_operator.notify import sinks
from surveillance_operator.notify.news import News, news_of
from surveillance_operator.notify.outbox import DeliveryError, Outbox
from surveillance_operator.notify.pipeline import notifier
from surveillance_operator.notify.settings import read_notify_file, sink_from
from surveillance_operator.notify.sinks import sink_of
from surveillance_runtime.incidents import Call, Cause, Incident, Severity
from tests.operator.ports import await_listening, free_port

SECRET = 'hunter2hunter2'


def news(key: str = 'k1', **fields: Any) -> News:
    values = {
        'text': '3: door D1 is ajar in C1',
        'kind': 'event',
        'name': '3',
        'node': 'observer',
        'robot': 'Robot1',
        'over': False,
        'at': 1000.0,
    }
    return News(key, **{**values, **fields})


class Hook:
    """A webhook's other end: keeps what is posted, answers what it is told to."""

    def __init__(self) -> None:
        self.posts: list[tuple[dict[str, str], dict[str, Any]]] = []
        self.answers: list[int] = []
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers['Content-Length']))
                outer.posts.append((dict(self.headers), json.loads(body)))
                status = outer.answers.pop(0) if outer.answers else 204
                self.send_response(status)
                if status == 302:
                    self.send_header('Location', f'{outer.address}/elsewhere')
                self.send_header('Content-Length', '0')
                self.end_headers()

            def log_message(self, *_: Any) -> None:
                pass

        self.server = ThreadingHTTPServer(('127.0.0.1', 0), Handler)
        self.address = f'http://127.0.0.1:{self.server.server_port}'
        threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True).start()


@pytest.fixture
def hook() -> Iterator[Hook]:
    server = Hook()
    yield server
    server.server.shutdown()
    server.server.server_close()


def evidence(folder: Path, name: str) -> Path:
    picture = np.random.default_rng(0).integers(0, 255, (120, 160, 3)).astype(np.uint8)
    path = folder / name
    cv2.imwrite(str(path), picture)
    return path


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
    script.write_text(f'#!/bin/sh\necho "$1" > {tmp_path}/line\ncat > {tmp_path}/json\n')
    script.chmod(0o755)
    sink_of(sink_from('c', {'command': str(script)}))(news())
    assert (tmp_path / 'line').read_text() == '3: door D1 is ajar in C1\n'
    assert json.loads((tmp_path / 'json').read_text())['key'] == 'k1'


# --- the outbox ---


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class Sink:
    def __init__(self) -> None:
        self.taken: list[str] = []
        self.problems: list[DeliveryError] = []

    def __call__(self, each: News) -> None:
        if self.problems:
            raise self.problems.pop(0)
        self.taken.append(each.key)


def test_what_fails_is_tried_again_at_growing_distances_in_order(tmp_path: Path) -> None:
    clock, sink, said = Clock(), Sink(), []
    sink.problems = [DeliveryError('no answer in time') for _ in range(5)]
    outbox = Outbox(tmp_path, {'a': sink}, said.append, clock)
    outbox.put(news('k1'))
    outbox.put(news('k2'))
    waits = []
    while (due := outbox.deliver_due('a')) is not None:
        waits.append(due - clock.now)
        clock.now = due
    assert waits == [1.0, 2.0, 4.0, 8.0, 16.0]
    assert sink.taken == ['k1', 'k2']
    assert said == ['a: no answer in time; it is tried again', 'a: works again']
    assert outbox.waiting() == {'a': 0}


def test_nothing_is_lost_or_told_twice_over_a_restart(tmp_path: Path) -> None:
    clock, away, there = Clock(), Sink(), Sink()
    away.problems = [DeliveryError('refused')]
    first = Outbox(tmp_path, {'away': away, 'there': there}, now=clock)
    first.put(news('k1'))
    first.put(news('k2'))
    first.deliver_due('away')
    first.deliver_due('there')
    assert (away.taken, there.taken) == ([], ['k1', 'k2'])
    (tmp_path / 'away' / '0.json').write_text('{"cut o')  # a crash in the middle of writing
    again = Outbox(tmp_path, {'away': away, 'there': there}, now=clock)
    assert not again.put(news('k1'))
    assert again.put(news('k3'))
    again.deliver_due('away')
    again.deliver_due('there')
    assert (away.taken, there.taken) == (['k1', 'k2', 'k3'], ['k1', 'k2', 'k3'])


def test_one_sink_that_hangs_does_not_hold_up_another(tmp_path: Path) -> None:
    hang, told = threading.Event(), threading.Event()

    def slow(_: News) -> None:
        hang.wait(60.0)

    outbox = Outbox(tmp_path, {'slow': slow, 'quick': lambda _: told.set()})
    outbox.start()
    outbox.put(news(at=time.time()))
    assert told.wait(60.0)
    assert outbox.waiting()['slow'] == 1
    hang.set()
    outbox.close()


def test_what_cannot_be_delivered_is_dropped_with_a_line_and_the_queue_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('surveillance_operator.notify.outbox.MOST_WAITING', 3)
    clock, sink, said = Clock(), Sink(), []
    sink.problems = [DeliveryError('answered 400', final=True)]
    outbox = Outbox(tmp_path, {'a': sink}, said.append, clock)
    for number in range(5):
        outbox.put(news(f'k{number}'))
    outbox.deliver_due('a')
    assert sink.taken == ['k3', 'k4']
    assert said[-1] == 'a: answered 400; not told: 3: door D1 is ajar in C1'
    sink.problems = [DeliveryError('away')] * 2
    outbox.put(news('old'))
    outbox.deliver_due('a')
    clock.now += 2 * 86400.0
    outbox.deliver_due('a')
    assert said[-1].startswith('a: away; not told')


def test_news_of_an_event_have_its_pictures_and_one_key_for_one_call(tmp_path: Path) -> None:
    event = {'place': 'C1', 'evidence': ['3_1_a.jpg', '../3_2_b.jpg']}
    (tmp_path / 'event_3.json').write_text(json.dumps(event))
    incident = Incident('observer', Cause('event', '3'), 'door', Severity.ALARM, 10.0)
    call = Call('door', incident, 1, over=False)
    told = news_of(call, 'Robot1', 1000.0, tmp_path)
    assert told.event == event
    assert told.pictures == (str(tmp_path / '3_1_a.jpg'), str(tmp_path / '3_2_b.jpg'))
    assert told.key == news_of(call, 'Robot1', 1200.0, tmp_path).key
    assert told.key != news_of(call._replace(number=2), 'Robot1', 1000.0, tmp_path).key
    assert News.from_kept(told.kept()) == told


def test_an_incident_of_a_node_arrives_at_a_webhook(hook: Hook, tmp_path: Path) -> None:
    (tmp_path / 'notify.yaml').write_text(f'sinks:\n  office: {{webhook: "{hook.address}"}}\n')
    outbox, tell = notifier(tmp_path / 'notify.yaml', tmp_path, 'Robot1', lambda _: None)
    alarm = Alarm(tell, tmp_path)
    alarm.hear('observer', 'incident [event 3, alarm]: 3: door D1 is ajar in C1')
    outbox.close(patience=10.0)
    alarm.close()
    ((_, body),) = hook.posts
    assert (body['kind'], body['name'], body['text']) == ('event', '3', '3: door D1 is ajar in C1')


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
        ({'webhok': 'x'}, 'expected one of webhook, mqtt, email, command, got 0'),
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
