"""The page behind the proxies that the documents advise, as they are installed on Debian."""

from __future__ import annotations

import http.client
import json
import os
import shutil
import socket
import ssl
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from tests.operator.ports import await_listening, free_port

PROXY = Path(__file__).parents[2] / 'docs' / 'proxy'
NAME = 'robot.example.org'
ORIGIN = f'https://{NAME}'
COMMANDS = {
    'nginx.conf': [
        'nginx',
        '-c',
        '{file}',
        '-g',
        'daemon off; pid {folder}/pid; error_log stderr;',
    ],
    'Caddyfile': ['caddy', 'run', '--config', '{file}', '--adapter', 'caddyfile'],
}

done: list[str] = []


def door(door: str) -> str:
    done.append(door)
    return 'done'


@pytest.fixture(scope='module')
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Provide a folder with a certificate that a machine gave itself."""
    if shutil.which('openssl') is None:
        pytest.skip('openssl is not installed')
    folder = tmp_path_factory.mktemp('tls')
    words = ['openssl', 'req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-days', '2']
    words += ['-subj', f'/CN={NAME}', '-keyout', 'robot.key', '-out', 'robot.crt']
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    return folder


@pytest.fixture(params=list(COMMANDS))
def proxied(
    request: pytest.FixtureRequest, certificate: Path, tmp_path: Path
) -> Iterator[tuple[Page, int]]:
    """Provide a page, and the port of a proxy with TLS in front of it."""
    command = COMMANDS[request.param]
    if shutil.which(command[0]) is None:
        pytest.skip(f'{command[0]} is not installed')
    if command[0] == 'nginx' and os.getuid() != 0:
        pytest.skip('nginx keeps what it receives below /var/lib, where root alone may write')
    done.clear()
    page = Page(
        Broadcaster(), questions={}, actions={'door': door}, port=0, token='secret', origin=ORIGIN
    )
    page.start()
    port = free_port()
    text = (PROXY / request.param).read_text()
    text = text.replace('/etc/ssl', str(certificate)).replace(
        '127.0.0.1:8080', f'127.0.0.1:{page.port}'
    )
    text = text.replace('listen 443', f'listen 127.0.0.1:{port}')
    text = text.replace(f'https://{NAME} {{', f'https://{NAME}:{port} {{')
    file = tmp_path / request.param
    file.write_text(text)
    words = [word.format(file=file, folder=tmp_path) for word in command]
    with subprocess.Popen(words, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        try:
            await_listening(port, process)
            yield page, port
        finally:
            process.terminate()
            process.wait()
            page.stop()


def ask(
    port: int, method: str, path: str, body: str = '', **headers: str
) -> tuple[int, str, http.client.HTTPMessage]:
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    with socket.create_connection(('127.0.0.1', port), timeout=60) as plain:
        connection = http.client.HTTPConnection(NAME, port, timeout=60)
        connection.sock = context.wrap_socket(plain, server_hostname=NAME)
        connection.request(method, path, body, {'Host': f'{NAME}:{port}', **headers})
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
    return answer.status, text, answer.headers


def test_a_person_behind_a_proxy_looks_and_acts_with_the_token(proxied: tuple[Page, int]) -> None:
    page, port = proxied
    assert page.address == f'{ORIGIN}/?token=secret'
    # Whoever comes through the proxy comes from this machine: looking needs the token, too.
    assert ask(port, 'GET', '/')[0] == 403
    status, _, headers = ask(port, 'GET', '/?token=secret')
    assert status == 303
    assert 'Secure' in headers['set-cookie']
    token = {'Cookie': f'mission_{page.port}=secret'}
    assert ask(port, 'GET', '/', **token)[0] == 200
    good = {**token, 'Origin': ORIGIN}
    status, text, _ = ask(port, 'POST', '/act/door', '{"door": "D1"}', **good)
    assert (status, json.loads(text)['ok']) == (200, True)
    evil = {**token, 'Origin': 'https://evil.example'}
    assert ask(port, 'POST', '/act/door', '{"door": "D2"}', **evil)[0] == 403
    assert done == ['D1']
