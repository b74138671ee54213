"""What the observer did not see is told, with the reason."""

from __future__ import annotations

import pytest

from indoor_watch.lost_sight import DROPPED, FEWEST, NO_POSE, NONE_CAME, SILENT, WINDOW, LostSight


class Clock:
    time = 100.0

    def __call__(self) -> float:
        return self.time


@pytest.fixture
def clock() -> Clock:
    return Clock()


def test_it_says_once_what_costs_many_pictures_until_that_is_over(clock):
    lost = LostSight(clock)

    def come(count: int, *causes: str) -> None:
        for _ in range(count):
            clock.time += 2.0
            lost.count('pictures', *causes)

    come(5, NO_POSE)
    assert not lost.findings(), 'ten seconds of a start are no reason to worry anybody'
    come(15, NO_POSE)
    ((cause, text),) = lost.findings().items()
    assert cause == ('pictures', NO_POSE)
    assert 'many pictures count for little' in text
    assert 'amcl_pose, odom, joint_states' in text
    come(20)
    assert lost.findings() == {cause: text}, 'the same words while it goes on'
    come(12)
    assert not lost.findings()
    assert lost.lost == {cause: 20}


def test_few_losses_and_those_of_another_source_say_nothing(clock):
    lost = LostSight(clock)
    for number in range(60):
        clock.time += 1.0
        lost.count('sweeps', *([DROPPED] if number % 3 == 0 else []))
        if number % 2:
            lost.count('pictures', DROPPED)
    assert list(lost.findings()) == [('pictures', DROPPED)]
    clock.time += WINDOW + 1.0
    for _ in range(FEWEST - 1):
        lost.count('sweeps', DROPPED)
    assert not lost.findings()


def test_a_camera_that_is_there_and_sends_nothing_is_told(clock):
    lost = LostSight(clock)
    clock.time += 100.0
    assert not lost.findings(), 'there is none'
    lost.expect('pictures', True)
    clock.time += SILENT - 1.0
    lost.expect('pictures', True)
    lost.come('pictures')
    clock.time += SILENT - 1.0
    assert not lost.findings()
    clock.time += 1.0
    assert list(lost.findings()) == [('pictures', NONE_CAME)]
    assert lost.findings()['pictures', NONE_CAME].startswith('no pictures came')
    lost.come('pictures')
    assert not lost.findings()
    clock.time += SILENT
    lost.expect('pictures', False)
    assert not lost.findings()
