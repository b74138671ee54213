"""The robots of a fleet, a line for each."""

from __future__ import annotations

from surveillance_operator.fleet_table import fleet_lines
from tests.operator.missions import FLEET


def test_each_robot_has_a_line_and_what_is_wrong_one_below_it() -> None:
    bad = FLEET['bert'].having(stopped=True)
    shared = FLEET[''].having(ended=frozenset({'simulator'}))
    lines = fleet_lines({'anna': FLEET['anna'], 'bert': bad, '': shared})
    assert [' '.join(line.split()) for line in lines] == [
        'anna A battery 80 % on its way to B; shares A, B, next B',
        'bert A battery 80 % stopped; shares A, B, next B',
        'bert ! stopped until a person releases it',
        'shared ! ended: simulator',
    ]


def test_what_is_not_known_of_a_robot_is_a_dash() -> None:
    (line,) = fleet_lines({'anna': FLEET['anna'].having(battery=None, status=None)})
    assert line.split()[:3] == ['anna', '–', '–']
