"""The reserve for the way home, and the draw that is learned."""

from __future__ import annotations

import pytest

from patrol_policy.battery_reserve import BatteryLimits, Draw, reserve

from .worlds import seven_rooms


def test_the_reserve_covers_the_worst_leg_and_the_way_home() -> None:
    graph = seven_rooms()
    limits = BatteryLimits(10, 90, 5)
    level, words = reserve(graph, 'C2', ['R3', 'R4', 'E'], ['E'], Draw(1.0), 0.0, limits)
    away = graph.seconds('C2', 'R4') + graph.seconds('R4', 'E')
    assert level == pytest.approx(away + 5.0)
    assert words == (
        f'to R4 and home takes {away:.1f} s at 1 %/s, '
        f'in 99 of 100 cases at most {away:.1f} %, plus a margin of 5 %'
    )


def test_the_reserve_leaves_a_charged_robot_room_to_go() -> None:
    graph = seven_rooms()
    draw, limits = Draw(50.0), BatteryLimits(10, 90, 5)
    assert reserve(graph, 'C2', ['R4'], ['E'], draw, 0.0, limits)[0] == 85.0
    assert reserve(graph, 'C2', [], ['E'], draw, 0.0, limits)[0] == 10


def test_battery_limits_out_of_order_are_named() -> None:
    with pytest.raises(ValueError, match=r'expected 0 <= battery_require_recharge < .* got 95 and'):
        BatteryLimits(95.0, 90.0)
