"""The reserve for the way home, and the draw that is learned."""

from __future__ import annotations

import pytest

from surveillance_behaviour.policy.battery_reserve import BatteryLimits, DrawEstimate, reserve

from .worlds import seven_rooms


def test_the_reserve_covers_the_worst_leg_and_the_way_home() -> None:
    graph = seven_rooms()
    level, words = reserve(graph, 'C2', ['R3', 'R4', 'E'], ['E'], 1.0, BatteryLimits(10, 90, 5))
    away = graph.seconds('C2', 'R4') + graph.seconds('R4', 'E')
    assert level == pytest.approx(away + 5.0)
    assert words == f'R4 and home from there takes {away:.1f} s at 1 % a second, with 5 % to spare'


def test_the_reserve_leaves_a_charged_robot_room_to_go() -> None:
    graph = seven_rooms()
    level, _ = reserve(graph, 'C2', ['R4'], ['E'], 50.0, BatteryLimits(10, 90, 5))
    assert level == 85.0
    assert reserve(graph, 'C2', [], ['E'], 50.0, BatteryLimits(10, 90, 5))[0] == 10


def test_the_draw_is_learnt_from_the_worst_leg() -> None:
    draw = DrawEstimate()
    for time, level in [(0.0, 100.0), (10.0, 97.0), (20.0, 92.0), (30.0, 90.0)]:
        draw.observe(time, level)
    assert draw.percent_per_second == pytest.approx(0.6)
    draw.observe(40.0, 100.0)
    draw.observe(50.0, 99.0)
    assert draw.percent_per_second == pytest.approx(0.6)
    jump = DrawEstimate()
    for time, level in [(0.0, 100.0), (9.0, 97.0), (20.0, 94.0), (30.0, 91.0), (40.0, 88.0)]:
        jump.observe(time, level)
    jump.observe(41.0, 60.0)
    assert jump.percent_per_second < 1.0, 'one jump of the level is no draw'
    assert DrawEstimate(fixed=0.1).percent_per_second == 0.1


def test_battery_limits_out_of_order_are_named() -> None:
    with pytest.raises(ValueError, match=r'expected 0 <= battery_require_recharge < .* got 95 and'):
        BatteryLimits(95.0, 90.0)
