from __future__ import annotations

import contextlib
import io

import pytest

from launcher.progress import SetUpStep, describe


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ('line', 'shown'),
    [
        ('  [12/266] Building C object CMakeFiles/x.dir/y.c.o', 'compiling 12/266'),
        ('Collecting numpy>=1.26', 'looking for numpy>=1.26'),
        ('  Downloading numpy-2.1.0-cp311-manylinux.whl (16.8 MB)', 'downloading numpy'),
        ('  Downloading https://host/a/owlready2-0.50.tar.gz', 'downloading owlready2'),
        ('Installing collected packages: a, b', 'installing'),
        ('Building wheels for collected packages: owlready2', 'building collected'),
        ('  Installing build dependencies: started', 'fetching build tools'),
        (
            'Get:3 http://deb/debian trixie/main amd64 g++-14 amd64 14.2.0-19 [26 kB]',
            'downloading g++-14',
        ),
        ('Setting up python3-dev (3.13.5-1) ...', 'installing python3-dev'),
        ('something else', ''),
    ],
)
def test_what_a_line_of_output_tells(line, shown):
    assert describe(line) == shown


def test_a_step_on_a_terminal_redraws_one_line():
    stream = Terminal()
    with SetUpStep(1, 3, 'packages', stream) as step:
        step.feed('Collecting numpy')
    assert stream.getvalue().count('\n') == 1
    assert '\r' in stream.getvalue()
    assert 'looking for numpy' in stream.getvalue()
    assert '[1/3] packages: done in' in stream.getvalue()


def test_a_step_on_a_narrow_terminal_keeps_to_one_line(monkeypatch):
    monkeypatch.setenv('COLUMNS', '40')
    stream = Terminal()
    with SetUpStep(1, 3, 'Python packages, ROS 2 Jazzy among them', stream) as step:
        step.feed('Collecting numpy')
    drawn = stream.getvalue().split('\r\x1b[K')[1:-1]
    assert drawn
    assert all(len(line) < 40 for line in drawn)


def test_a_step_that_printed_nothing_yet_ends_its_line_with_the_time(monkeypatch):
    monkeypatch.setattr('launcher.progress._PLAIN_EVERY', 0.0)
    stream = io.StringIO()
    with SetUpStep(1, 3, 'environment', stream) as step:
        step.tick()
    assert stream.getvalue().splitlines()[1] == '[1/3] environment: 0 s'


def test_a_step_that_hears_nothing_says_for_how_long_and_of_what(monkeypatch):
    now = iter([0.0, 1.0, 2.0, 25.0, 40.0, 41.0])
    monkeypatch.setattr('launcher.progress.time.monotonic', lambda: next(now))
    stream = io.StringIO()
    with SetUpStep(1, 3, 'packages', stream) as step:
        step.feed('Downloading numpy-2.0-cp311.whl')
        step.tick()
    assert stream.getvalue().splitlines()[1] == (
        '[1/3] packages: 25 s, downloading numpy, nothing new for 24 s'
    )


def test_a_step_elsewhere_prints_a_line_at_its_start_and_its_end():
    stream = io.StringIO()
    with contextlib.suppress(RuntimeError), SetUpStep(2, 3, 'interfaces', stream) as step:
        step.feed('[1/2] compiling')
        raise RuntimeError
    assert stream.getvalue().splitlines() == [
        '[2/3] interfaces ...',
        '[2/3] interfaces: stopped after 0 s',
    ]
