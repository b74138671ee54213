"""The unit of the user's systemd."""

from __future__ import annotations

import configparser
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import uuid
from pathlib import Path

import pytest

from launcher.cli import main
from launcher.service import is_service, notify, unit_path, unit_text
from tests.launcher.conftest import ROOT, USER_ENVIRON

MISSION = str(Path(__file__).with_name('mission_process.py'))


def listening(listener: socket.socket) -> str:
    """Give a socket a name, and return it as systemd says it: a path may be too long for one."""
    name = f'surveillance-test-{uuid.uuid4()}'
    listener.bind(f'\0{name}')
    return f'@{name}'


def test_the_unit_runs_the_command_line_that_was_asked_for():
    text = unit_text(Path('/home/a b/50%'), ['--mode', 'RANDOM', '--alarm', 'mail $ME \\t'], 4096)
    parser = configparser.RawConfigParser(strict=False)
    parser.optionxform = str  # type: ignore[assignment]
    parser.read_string(text)
    service = parser['Service']
    assert service['ExecStart'].endswith(
        "'/home/a b/50%%/launch.py' run --mode RANDOM --alarm 'mail $$ME \\\\t'"
    )
    assert service['MemoryMax'] == '4096M'
    assert int(service['WatchdogSec']) >= 10
    assert service['Restart'] == 'always'
    assert service['RestartPreventExitStatus'] == '2'


@pytest.mark.skipif(shutil.which('systemd-analyze') is None, reason='no systemd here')
def test_systemd_takes_the_unit(tmp_path):
    path = tmp_path / 'surveillance.service'
    path.write_text(unit_text(ROOT, [], 4096))
    done = subprocess.run(
        ['systemd-analyze', 'verify', '--user', str(path)],
        capture_output=True,
        text=True,
        env={**os.environ, 'XDG_RUNTIME_DIR': str(tmp_path)},
    )
    # What it says of other units is not our matter.
    assert (done.returncode, path.name in done.stderr) == (0, False), done.stderr


def test_the_command_writes_it_into_the_users_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path))
    assert main(['service', '--mode', 'random']) == 0
    assert unit_path().read_text().count('run --mode random') == 1
    assert 'systemctl --user' in capsys.readouterr().out
    with pytest.raises(SystemExit, match='2'):
        main(['service', '--print', '--memory', '5'])


def test_a_service_that_is_stopped_with_its_machine_goes_on_later(start, tmp_path, ros_domain):
    runs = tmp_path / 'runs'
    words = (MISSION, str(runs), '--only', 'armor_server', '--domain', str(ros_domain))
    for _ in range(2):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
            address = listening(listener)
            listener.settimeout(240.0)
            service = start(*words, environ={**USER_ENVIRON, 'NOTIFY_SOCKET': address})
            assert [listener.recv(100) for _ in range(3)] == [b'READY=1', *2 * [b'WATCHDOG=1']]
            assert service.end(signal.SIGTERM)[0] == 0
    (folder,) = runs.iterdir()
    assert f'continuing {folder}, which was not finished' in '\n'.join(service.lines)


def test_only_a_leading_at_sign_stands_for_an_abstract_name(monkeypatch):
    with (
        tempfile.TemporaryDirectory(dir='/tmp') as folder,  # a path has to be short
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener,
    ):
        path = f'{folder}/user@1000'
        listener.bind(path)
        listener.setblocking(False)
        monkeypatch.setenv('NOTIFY_SOCKET', path)
        monkeypatch.delenv('SYSTEMD_EXEC_PID', raising=False)
        notify('READY=1')
        assert listener.recv(100) == b'READY=1'


def test_systemd_is_told_where_it_listens(tmp_path, monkeypatch):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        address = listening(listener)
        monkeypatch.setenv('NOTIFY_SOCKET', address)
        for started in (None, str(os.getpid())):
            monkeypatch.delenv('SYSTEMD_EXEC_PID', raising=False)
            if started is not None:
                monkeypatch.setenv('SYSTEMD_EXEC_PID', started)
            notify('READY=1')
            assert listener.recv(100) == b'READY=1'
        # In a terminal that is a service itself.
        monkeypatch.setenv('SYSTEMD_EXEC_PID', str(os.getppid()))
        assert not is_service()
        notify('READY=1')
        listener.setblocking(False)
        with pytest.raises(BlockingIOError):
            listener.recv(100)
    monkeypatch.delenv('SYSTEMD_EXEC_PID')
    monkeypatch.setenv('NOTIFY_SOCKET', str(tmp_path / 'nobody'))
    notify('READY=1')
    monkeypatch.delenv('NOTIFY_SOCKET')
    notify('READY=1')
