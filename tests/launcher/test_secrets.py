"""A whole run keeps its secrets: the page's token and the passwords of those who are told.

They are looked for in what the launcher prints, in every file that the run leaves, in each recorded
message (`/rosout` among them) and in the command lines of its processes.
"""

from __future__ import annotations

import os
import signal
import stat
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

from surveillance_operator.recording.reading import Messages
from surveillance_runtime.run_files import RECORDING
from tests.launcher.conftest import ROOT, USER_ENVIRON, Started
from tests.operator.ports import free_port

PROCESS = str(Path(__file__).with_name('mission_process.py'))
WEBHOOK, PASSWORD = 'webhook-secret-5c1b', 'mail-password-9e2d'
KEPT = ('page_token',)
"""Files whose purpose is to hold one, for their owner alone."""


def command_lines() -> Iterator[str]:
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            yield (folder / 'cmdline').read_bytes().replace(b'\0', b' ').decode(errors='replace')
        except OSError:
            continue


def asked(address: str, **headers: str) -> int:
    """Return the status of a request, a POST where it has headers."""
    data = b'{}' if headers else None
    try:
        with urllib.request.urlopen(urllib.request.Request(address, data, headers)) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_no_secret_leaves_its_file(
    start: Callable[..., Started], tmp_path: Path, ros_domain: int
) -> None:
    password = tmp_path / 'password'
    password.write_text(f'{PASSWORD}\n')
    password.chmod(0o600)
    notify = tmp_path / 'notify.yaml'
    notify.write_text(
        'sinks:\n'
        '  office: {webhook: "http://127.0.0.1:9/hook", token_env: OFFICE_TOKEN}\n'
        '  guard: {email: guard@example.org, from: robot@example.org, '
        f'smtp: "smtp://127.0.0.1:9", user: robot, password_file: {password}}}\n'
    )
    port = free_port(ros_domain)
    mission = start(
        *(PROCESS, str(tmp_path / 'runs'), '--domain', str(ros_domain), '--composed'),
        *('--mode', 'RANDOM', '--params', str(ROOT / 'config/fast.yaml')),
        *('--web-control', '--web-address', f'127.0.0.1:{port}', '--notify', str(notify)),
        environ={**USER_ENVIRON, 'OFFICE_TOKEN': WEBHOOK},
    )
    shown = mission.until(r'the mission is shown at (\S+) \(its token is in ([^)]+)\)')
    page, file = shown[1], Path(shown[2])
    token = file.read_text().strip()
    assert len(token) >= 20
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    # Whoever opens the page with it, acts with it, or has another one, leaves no trace of it.
    assert asked(f'{page}?token={token}') == 200
    asked(f'{page}act/nothing', Authorization=f'Bearer {token}')
    asked(f'{page}act/nothing', Authorization=f'Bearer {token}x')
    mission.until('the robot is in')
    seen = list(command_lines())
    code, _ = mission.end(signal.SIGINT)
    assert code in (0, 130)
    secrets = {'token': token, 'webhook': WEBHOOK, 'password': PASSWORD}
    found = [f'ps: {name}' for name, each in secrets.items() if any(each in line for line in seen)]
    found += [
        f'terminal: {name}' for name, each in secrets.items() if each in '\n'.join(mission.lines)
    ]
    folders = list((tmp_path / 'runs').iterdir())
    assert len(folders) == 1
    files = [Path(at, name) for at, _, names in os.walk(folders[0]) for name in names]
    assert any(each.name == 'launch.log' for each in files)
    for each in files:
        content = each.read_bytes()
        if each.name not in KEPT:
            found += [f'{each}: {name}' for name, s in secrets.items() if s.encode() in content]
    messages, topics = Messages(folders[0] / RECORDING), set()
    for topic, _, data in messages.in_order():
        topics.add(topic)
        found += [f'{topic}: {name}' for name, each in secrets.items() if each.encode() in data]
    messages.close()
    assert '/rosout' in topics, 'the log is in the recording'
    assert not found
