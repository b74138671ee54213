"""What is known of whether the robot stands in a dock."""

from __future__ import annotations

import math

import pytest

from surveillance_controllers.motion.dock_contact import Contact, DockMemory, stands_at


@pytest.mark.parametrize(
    ('told', 'charging', 'is_near', 'expected'),
    [
        (None, None, True, Contact.DOUBTFUL),
        (None, None, None, Contact.DOUBTFUL),
        (None, None, False, Contact.FREE),
        (True, None, None, Contact.DOCKED),
        (True, False, True, Contact.DOCKED),
        (True, False, False, Contact.FREE),
        (False, None, True, Contact.FREE),
        (False, True, True, Contact.DOCKED),
        (False, True, None, Contact.DOCKED),
        (False, True, False, Contact.DOUBTFUL),
    ],
)
def test_what_is_seen_counts_before_what_was_done(
    told: bool | None, charging: bool | None, is_near: bool | None, expected: Contact
) -> None:
    assert DockMemory(told).look(charging, is_near) is expected


def test_a_robot_that_was_pushed_away_is_free_when_it_comes_near_again() -> None:
    memory = DockMemory(told=True)
    assert memory.look(False, False) is Contact.FREE
    assert memory.look(False, True) is Contact.FREE


def test_a_robot_may_stand_in_its_dock_either_way_round() -> None:
    dock = (3.0, 4.0, 1.0)
    assert stands_at((3.1, 4.1, 1.2), dock, 0.5)
    assert stands_at((3.1, 4.1, 1.2 - math.pi), dock, 0.5)
    assert not stands_at((3.1, 4.1, 1.0 + math.pi / 2), dock, 0.5)
    assert not stands_at((3.6, 4.0, 1.0), dock, 0.5)
