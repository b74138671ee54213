from __future__ import annotations

import io
import re
from pathlib import Path

import pytest

from launcher.log_merge import LONGEST_LINE, ROS_FORMAT, LogFile, MergedLog, bounded
from surveillance_runtime.launch_protocol import FOR_THE_TERMINAL


@pytest.fixture
def stream():
    return io.StringIO()


def body(text):
    """Lines without the time in front."""
    return [re.sub(r'^\d\d:\d\d:\d\d\.\d{3} ', '', line) for line in text.splitlines()]


def logged(severity, name, message):
    """Return a line as a node prints it that the launcher started."""
    return ROS_FORMAT.format(severity=severity, name=name, message=message)


def test_a_ros_line_shows_its_node_and_severity(stream):
    log = MergedLog(stream, ['armor_server', 'robot_behavior'])
    log.line('armor_server', logged('INFO', 'armor_server', 'ready'))
    log.line('armor_server', logged('WARN', 'robot1.armor_server', 'slow'))
    log.line('armor_server', logged('ERROR', 'rmw_fastrtps', 'no network'))
    log.say('started')
    assert body(stream.getvalue()) == [
        'armor_server   | ready',
        'armor_server   | WARN: slow',
        'armor_server   | ERROR: rmw_fastrtps: no network',
        'launch         | started',
    ]


def test_a_process_of_several_nodes_is_shown_by_node(stream):
    log = MergedLog(stream, ['one', 'two', 'composed'])
    log.line('composed', logged('INFO', 'two', 'hello'))
    assert body(stream.getvalue()) == ['two      | hello']


def test_what_a_console_says_for_a_node_is_shown_by_node(stream):
    log = MergedLog(stream, ['two', 'composed'])
    log.line('composed', '[two] New request')
    log.line('composed', '[0, 1] is no point')
    assert body(stream.getvalue()) == ['two      | New request', 'composed | [0, 1] is no point']


@pytest.mark.parametrize(('columns', 'shown'), [(64, 2), (30, 1), (120, 1)])
def test_on_a_terminal_a_long_line_is_broken_at_words(monkeypatch, tmp_path, columns, shown):
    monkeypatch.setenv('COLUMNS', str(columns))
    monkeypatch.setenv('NO_COLOR', '1')
    stream = io.StringIO()
    stream.isatty = lambda: True
    log = MergedLog(stream, ['one'], path=tmp_path / 'log')
    text = 'E is the nearest charging place, seven seconds away from here'
    log.line('one', logged('INFO', 'one', text))
    log.close()
    lines = stream.getvalue().splitlines()
    assert len(lines) == shown
    assert ' '.join(line.partition('| ')[2] for line in lines) == text
    assert all(line.startswith(' ' * 19 + ' | ') for line in lines[1:])
    assert shown == 1 or all(len(line) <= columns for line in lines)
    assert body((tmp_path / 'log').read_text()) == [f'one    | {text}']


def test_a_log_file_that_cannot_be_written_any_more_costs_one_warning(stream):
    log = MergedLog(stream, ['one'], path=Path('/dev/full'))
    log.line('one', 'first')
    log.line('one', 'second')
    log.close()
    warning = 'launch | WARN: /dev/full: No space left on device: the log continues only here'
    assert body(stream.getvalue()) == [warning, 'one    | first', 'one    | second']


def test_a_log_file_goes_on_when_the_disk_has_space_again(tmp_path):
    warnings, path = [], tmp_path / 'log'
    path.symlink_to('/dev/full')
    log = LogFile(path, warnings.append)
    log.write('lost')
    log.write('also lost')
    path.unlink()
    log.write('kept')
    log.close()
    assert len(warnings) == 1
    assert (tmp_path / 'log').read_text() == 'kept\n'


def test_a_log_file_has_a_bounded_size(tmp_path):
    log = LogFile(tmp_path / 'log', pytest.fail, most=1000)
    for number in range(1000):
        log.write(f'line {number}')
    log.close()
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert sorted(path.name for path in tmp_path.iterdir()) == ['log', 'log.1']
    assert max(sizes) < 1100
    kept = (tmp_path / 'log.1').read_text() + (tmp_path / 'log').read_text()
    assert kept.endswith('line 998\nline 999\n')


def test_a_redrawn_line_shows_what_it_ended_with(stream):
    log = MergedLog(stream, ['battery'])
    log.line('battery', 'charging 10 %\rcharging 100 %')
    log.line('battery', '')
    assert body(stream.getvalue()) == ['battery | charging 100 %']


def test_colours_are_for_the_stream_and_not_for_the_file(stream, tmp_path):
    log = MergedLog(stream, ['one'], colour=True, path=tmp_path / 'log')
    log.line('one', logged('ERROR', 'one', '\x1b[1mbroken\x1b[0m'))
    log.plain('the end')
    log.close()
    assert '\x1b[31m' in stream.getvalue()
    written = (tmp_path / 'log').read_text()
    assert '\x1b' not in written
    assert body(written) == ['one    | ERROR: broken', 'the end']


def test_no_colour_without_a_terminal(stream):
    log = MergedLog(stream, ['one'])
    log.warn('look')
    assert '\x1b' not in stream.getvalue()


def test_a_line_is_bounded_and_holds_no_control_characters():
    assert bounded('plain \x1b[31mred\x1b[0m') == 'plain \x1b[31mred\x1b[0m'
    assert bounded('a\x00b\x07c') == r'a\x00b\x07c'
    assert len(bounded('x' * 10**6)) < LONGEST_LINE + 60


@pytest.mark.parametrize('is_terminal', [True, False])
def test_what_is_for_the_terminal_is_in_no_log(tmp_path, is_terminal):
    stream = io.StringIO()
    stream.isatty = lambda: is_terminal
    log = MergedLog(stream, ['one'], path=tmp_path / 'log')
    log.line('one', f'{FOR_THE_TERMINAL}with its token: http://127.0.0.1:8080/?token=secret')
    log.say('the end')
    log.close()
    assert ('secret' in stream.getvalue()) == is_terminal
    assert 'secret' not in (tmp_path / 'log').read_text()
