"""What there is to say of a place: its ways are measured over its doors."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from floor_plans import read_place
from floor_plans.facts import counted, facts, graph_over_doors

PLAN = read_place(Path(__file__).with_name('places') / 'seven_rooms.yaml').plan


def test_the_tour_of_a_place_is_measured_over_the_doors() -> None:
    graph = graph_over_doors(PLAN)
    assert graph.leg_seconds['C1']['R1'] == pytest.approx(1.5 + 1.5)
    assert graph.leg_seconds['E']['C1'] == pytest.approx(math.hypot(2, 1.5) + math.hypot(3, 0.5))
    tour = f'{graph.tour.length:.1f}'
    assert facts(PLAN) == f'7 places · 7 doors · shortest tour {tour} m'


def test_one_is_no_plural() -> None:
    assert [counted(number, 'door') for number in (0, 1, 2)] == ['0 doors', '1 door', '2 doors']
