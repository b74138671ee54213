"""The armor server as a process of its own, killed in the middle."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from libs.armor_service.tests.seven_rooms import build_seven_rooms
from surveillance_ontology.armor_client import ArmorClient, ArmorServiceCallError


def start(store: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [
            *(sys.executable, '-m', 'surveillance_ontology.armor_server_node', '--ros-args'),
            *('-p', f'store:={store}', '--log-level', 'warn'),
        ]
    )


def test_a_killed_server_comes_back_with_what_it_answered_and_clients_go_on(
    graph: Any, tmp_path: Path
) -> None:
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    server = start(tmp_path / 'store')
    try:
        build_seven_rooms(armor, False, True)
        armor.utils.mount_on_ref()
        armor.manipulation.replace_objectprop_b2_ind('isIn', 'Robot1', 'C1', 'E')
        server.send_signal(signal.SIGKILL)
        server.wait()
        server = start(tmp_path / 'store')
        armor.transport.timeout = 1.0  # type: ignore[attr-defined]

        def reached() -> list[str] | None:
            try:
                return armor.query.objectprop_b2_ind('canReach', 'Robot1')
            except ArmorServiceCallError:
                return None

        assert graph.until(reached, timeout=60.0) == ['C2', 'E', 'R1', 'R2']
        assert armor.utils.get_ref_client() == 'test'
        server.send_signal(signal.SIGINT)
        assert server.wait(60.0) == 0
    finally:
        server.kill()
        server.wait()


def test_a_server_that_cannot_start_says_why_in_one_line(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    ended = subprocess.run(
        [
            *(sys.executable, '-m', 'surveillance_ontology.armor_server_node', '--ros-args'),
            *('-p', f'store:={tmp_path / "file" / "store"}'),
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == os.EX_TEMPFAIL
    (line,) = ended.stderr.strip().splitlines()
    assert 'armor_server: parameter store:' in line
