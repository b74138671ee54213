"""Console and watch on a real terminal, beside a real mission: what a person sees and types."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.launcher.conftest import Started
from tests.operator.beside_a_mission.conftest import LAUNCH
from tests.operator.terminal import Terminal

Open = Callable[..., Terminal]


@pytest.fixture
def terminal(mission_domain: int, tmp_path: Path) -> Iterator[Open]:
    opened: list[Terminal] = []

    def start(*words: str, columns: int = 80, rows: int = 40) -> Terminal:
        environ = {'XDG_STATE_HOME': str(tmp_path)}
        command = [*LAUNCH, *words, '--domain', str(mission_domain)]
        opened.append(Terminal(command, columns, rows, environ))
        return opened[-1]

    yield start
    for each in opened:
        each.close()


def test_the_console_answers_completes_remembers_and_ends(mission: Started, terminal: Open) -> None:
    console = terminal('console')
    console.until('why not ROOM', 'console>')
    console.until('· in ', 'battery')  # the status line
    console.type('why\r')
    console.until('decision')
    console.type('why n\t')  # completion
    console.until('console> why not')
    console.type(' R77\r')
    console.until("no place 'R77'", 'expected')
    console.type('door close D4\r')
    console.until('D4 is closed')
    console.type('\x1b[A\x1b[A\x7f\x7f\x7fR4\r')  # history: the line before the last, changed
    console.until('console> why not R4', 'R4')
    console.type('door open D4\r')
    console.until('D4 is open')
    console.type('pause\r')
    console.until('paused', 'PAUSED')
    console.type('resume\r')
    console.until('going on')
    assert all(len(line) <= 80 for line in console.lines)
    console.type('\x04')  # the end of the input
    assert console.ended() == 0

    again = terminal('console')
    again.until('console>')
    again.type('\x1b[A')  # the history outlives the console
    again.until('console> resume')
    again.type('\x03')  # Ctrl-C
    assert again.ended() == 0


def test_watch_fits_eighty_columns_and_its_keys_change_it(mission: Started, terminal: Open) -> None:
    watch = terminal('watch', rows=30)
    shown = watch.until('q quit', 'e events', 'battery', 'decision', 'R1')
    assert '…' not in shown.splitlines()[0]
    assert shown.rstrip().endswith('e events')
    watch.type('d')
    watch.until('policy tour', 'chosen')
    watch.type('n')
    watch.until('armor_server', 'up')
    watch.type('e')
    watch.until('arrived in')
    watch.type('ep')
    watch.until('HELD')
    watch.type('q')
    assert watch.ended() == 0


def test_a_person_answers_the_requests_of_mode_manual(terminal: Open, tmp_path: Path) -> None:
    words = ('--mode', 'MANUAL', '--namespace', 'manual', '--record', str(tmp_path))
    manual = terminal(*words, columns=120, rows=60)
    manual.until('New request: compute a path')
    manual.type('plan set [[7,9,0]]\r')
    manual.until('New request: follow')
    manual.type('move 1 0\r')
    manual.until('arrived in')
    manual.type('battery set 10\r')
    manual.until('battery low: 10 %')
    manual.type('status\r')
    manual.until('The battery is at 10 %')
    manual.type('exit\r')
    assert manual.ended() == 0


def test_the_arm_is_moved_from_the_terminal_of_mode_manual(terminal: Open, tmp_path: Path) -> None:
    words = ('--mode', 'MANUAL', '--behaviour', 'patrol', '--namespace', 'arm')
    words += ('--only', 'console,simulator,arm_controller', '--record', str(tmp_path))
    manual = terminal(*words, columns=120, rows=60)
    manual.until(*(f'{name:<14} | ready' for name in ('arm_controller', 'simulator', 'console')))
    manual.type('arm up\r')
    manual.until("arm: 'up': expected left, home, right, back")
    manual.type('arm left\r')
    manual.until('at pose left')
    manual.type('exit\r')
    assert manual.ended() == 0
