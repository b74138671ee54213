"""What a process prints."""

from __future__ import annotations

import subprocess
import sys

import pytest
import rclpy.impl.rcutils_logger as rcutils

from surveillance_runtime.logging import CleanLogger


def test_lines_of_two_threads_stay_whole() -> None:
    """A node's answers and announcements come from two threads; Python is unbuffered below the
    launcher."""
    program = (
        'import threading; from surveillance_runtime.logging import print_lines\n'
        'def say(who): [print_lines(who * 40) for _ in range(2000)]\n'
        'threads = [threading.Thread(target=say, args=(who,)) for who in "ab"]\n'
        '[each.start() for each in threads]; [each.join() for each in threads]\n'
    )
    said = subprocess.run([sys.executable, '-u', '-c', program], capture_output=True, check=True)
    assert set(said.stdout.decode().split('\n')) == {'a' * 40, 'b' * 40, ''}
    assert said.stdout.count(b'\n') == 4000


def test_a_line_on_rosout_names_who_said_it(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[tuple[object, ...]] = []
    monkeypatch.setattr(
        rcutils._rclpy, 'rclpy_logging_rcutils_log', lambda *line: said.append(line)
    )
    logger = CleanLogger('speaker')
    logger.warning('one\nline')
    logger.info('seldom', throttle_duration_sec=60.0)
    for _, name, text, function, file, _line in said:
        assert (name, function, file) == (
            'speaker',
            'test_a_line_on_rosout_names_who_said_it',
            __file__,
        ), text
    assert [line[2] for line in said] == ['one\\nline', 'seldom']
