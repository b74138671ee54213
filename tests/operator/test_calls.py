"""A person is called by a command and by the sinks of notify.yaml."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from surveillance_operator.notify.calls import open_sinks, run_command
from surveillance_operator.notify.incident_keeper import IncidentKeeper
from tests.operator.notify_peers import Hook, of_door


@pytest.fixture
def hook() -> Iterator[Hook]:
    server = Hook()
    yield server
    server.server.shutdown()
    server.server.server_close()


def test_an_incident_of_a_node_arrives_at_a_webhook(hook: Hook, tmp_path: Path) -> None:
    (tmp_path / 'notify.yaml').write_text(f'sinks:\n  office: {{webhook: "{hook.address}"}}\n')
    sinks = open_sinks(tmp_path / 'notify.yaml', tmp_path, 'Robot1', lambda _: None)
    keeper = IncidentKeeper(sinks.tell, tmp_path)
    keeper.hear(of_door())
    sinks.outbox.close(patience=240.0)
    keeper.close()
    ((_, body),) = hook.posts
    assert (body['kind'], body['name'], body['text']) == ('event', '3', '3: door D1 is ajar in C1')


def test_an_alarm_gets_one_line_as_its_last_argument(tmp_path):
    out = tmp_path / 'said'
    script = tmp_path / 'alarm.sh'
    script.write_text(f'printf "%s|" "$@" > "{out}.new"; mv "{out}.new" "{out}"\n')
    assert not run_command(f"sh '{script}' first", 'waiting for help: a door is closed')
    for _ in range(1200):
        if out.exists():
            break
        threading.Event().wait(0.05)
    assert out.read_text() == 'first|waiting for help: a door is closed|'
