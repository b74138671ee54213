"""What the robot knows when the machine's clock is set."""

from __future__ import annotations

import pytest

from surveillance_behaviour.experience import Experience


class Clock:
    """A date that may be set, and the seconds that pass."""

    def __init__(self) -> None:
        self.passed = 500.0
        self.date = 1_800_000_000.0

    def go_on(self, seconds: float, step: float = 0.0) -> float:
        self.passed += seconds
        self.date += seconds + step
        return self.date


@pytest.mark.parametrize('step', [3600.0, -3600.0, 1.0, -1.0])
def test_no_visit_gets_older_or_younger_when_the_clock_is_set(step: float) -> None:
    clock = Clock()
    experience = Experience(elapsed=lambda: clock.passed)
    experience.saw('A', clock.date)
    experience.saw('B', clock.go_on(10.0))
    now = clock.go_on(30.0, step)
    assert experience.tell_time(now) == (step if abs(step) > 1.0 else 0.0)
    ages = {place: now - at for place, at in experience.visits.items()}
    assert ages == pytest.approx({'A': 40.0, 'B': 30.0}, abs=1.001)


def test_a_minute_without_a_look_is_no_step() -> None:
    clock = Clock()
    experience = Experience(elapsed=lambda: clock.passed)
    experience.saw('A', clock.date)
    assert experience.tell_time(clock.go_on(60.0)) == 0.0
    assert experience.visits['A'] == clock.date - 60.0
