"""What a mission counts and learns: its summary, what was looked at, how a station charges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import pytest

from patrol_policy.battery import BANDS
from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.charge_estimate import ChargeEstimate
from surveillance_behaviour.charging import BatteryMonitor, charge
from surveillance_behaviour.mission.mission_log import InspectionLog, Summary, side_name, stand_name


def test_a_summary_is_a_table_of_the_places_and_a_line_for_each_count() -> None:
    summary = Summary(
        seconds=3661.4,
        visits=Counter({'R10': 2, 'C1': 1, 'A': 0}),
        unvisited={'R10': 12.34, 'C1': 600.0},
        recharges=1,
        charging_seconds=59.6,
        distance=123.45,
        rules=Counter({'urgent': 2, 'room': 5}),
        failures=Counter(),
        restarts=2,
    )
    assert str(summary).splitlines() == [
        'Mission: 1 h 01 min 01 s, 2 of 3 places visited, 3 visits, 123.5 m',
        '  place  visits  longest unvisited',
        '  A           0              0.0 s',
        '  C1          1            600.0 s',
        '  R10         2             12.3 s',
        '  recharges: 1 (1 min 00 s)',
        '  decisions by rule: room 5, urgent 2',
        '  failures: none',
        '  restarts of the behaviour: 2',
    ]
    one = str(Summary(seconds=3599.0, visits=Counter({'Long_name': 1}), restarts=0))
    assert one.splitlines()[0] == ('Mission: 59 min 59 s, 1 of 1 places visited, 1 visit, 0.0 m')
    assert one.splitlines()[2] == '  Long_name       1              0.0 s'
    assert 'restarts' not in one


def test_what_was_looked_at_last_comes_last() -> None:
    looked = InspectionLog({'A': ['0', '90']})
    assert [looked.rank('A', side) for side in ('0', '90', '180')] == [1, 2, 0]
    looked.note('A', '0', '180')
    assert [looked.rank('A', side) for side in ('90', '0', '180')] == [1, 2, 3]
    assert (looked.latest('A'), looked.latest('B'), looked.rank('B', '0')) == ('180', '', 0)
    looked.note('B', *map(str, range(201)))
    assert looked.to_json() == {'A': ['90', '0', '180'], 'B': [str(n) for n in range(1, 201)]}
    assert InspectionLog(looked.to_json()).to_json() == looked.to_json()
    assert stand_name(None) == 'own point'
    assert stand_name((1.5, -2.0)) == '1.5 -2'
    assert side_name(90, None) == '90'
    assert side_name(90, (1.5, -2.0)) == '90 from 1.5 -2'


# --- how a station charges ---


def rate(estimate: ChargeEstimate, place: str, level: float) -> float:
    return estimate.curves()[place].rates[min(BANDS - 1, int(level * BANDS / 100))]


def test_a_rate_counts_for_its_band_and_the_nearest_one_stands_for_the_others() -> None:
    estimate = ChargeEstimate()
    assert estimate.curves() == {}
    for time, level in ((0.0, 20.0), (10.0, 21.0), (20.0, 22.0), (30.0, 23.0), (40.0, 24.0)):
        estimate.observe('E', time, level)
    assert set(estimate.curves()['E'].rates) == {0.1}
    estimate.observe('E', 50.0, 90.0)  # 66 percent in 10 s: for the band of 57
    assert rate(estimate, 'E', 57.0) == 6.6
    assert [rate(estimate, 'E', level) for level in (0, 20, 35, 39, 40, 99)] == [
        0.1,
        0.1,
        0.1,
        0.1,
        6.6,
        6.6,
    ]
    estimate.observe('E', 150.0, 100.0)
    assert rate(estimate, 'E', 95.0) == 0.1
    assert len(estimate.curves()['E'].rates) == BANDS


def test_of_several_rates_the_median_of_the_last_nine_stands() -> None:
    estimate = ChargeEstimate()
    for number, seconds in enumerate([1.0] * 5 + [20.0] * 5):
        estimate.observe('E', 100.0 * number, 50.0)
        estimate.observe('E', 100.0 * number + seconds, 52.0)
        # Four of 2 %/s have a majority of one no more once five of 0.1 %/s came.
        expected = 2.0 if number < 9 else 0.1
        assert rate(estimate, 'E', 51.0) == expected


@pytest.mark.parametrize(
    ('second', 'learned'),
    [
        (('E', 10.0, 52.0), True),
        (('E', 10.0, 51.9), False),
        (('W', 10.0, 52.0), False),
        (('E', 0.0, 52.0), False),
        (('E', 86_400.0, 52.0), True),
        (('E', 86_401.0, 52.0), False),
        (('E', 10.0, 49.0), False),
    ],
)
def test_what_is_a_rise_of_one_charge(second: tuple[str, float, float], learned: bool) -> None:
    estimate = ChargeEstimate()
    estimate.observe('E', 0.0, 50.0)
    estimate.observe(*second)
    assert (estimate.curves() != {}) is learned


def test_a_level_that_falls_begins_a_rise_anew() -> None:
    estimate = ChargeEstimate()
    for time, level in ((0.0, 50.0), (10.0, 40.0), (30.0, 42.0)):
        estimate.observe('E', time, level)
    assert rate(estimate, 'E', 41.0) == 0.1


def test_what_was_learned_is_kept_and_what_it_cannot_be_is_refused() -> None:
    estimate, again = ChargeEstimate(), ChargeEstimate()
    estimate.observe('E', 0.0, 20.0)
    estimate.observe('E', 20.0, 22.0)
    assert estimate.to_json() == {'E': {'4': [0.1]}}
    again.restore(estimate.to_json())
    assert again.curves() == estimate.curves()
    for wrong in ({'20': [0.1]}, {'-1': [0.1]}, {'4': [0.0]}, {'4': [1000.0]}, {'4': [0.1, -1]}):
        with pytest.raises(ValueError, match='charge rates of E: expected positive ones by band'):
            again.restore({'E': wrong})
    again.restore({'E': {'0': [999.0], '19': [0.2]}})
    assert again.curves()['E'].rates[19] == 0.2


# --- one charge ---


class Clock:
    """A clock whose sleeps do what they are told to, and then are over."""

    def __init__(self, *steps: Callable[[], None]) -> None:
        self.steps = list(steps)
        self.slept: list[float] = []

    def now(self) -> float:
        return 0.0

    def sleep(self, seconds: float, interrupt: Interrupt) -> bool:
        self.slept.append(seconds)
        if self.steps:
            self.steps.pop(0)()
        return not interrupt.is_set()


def battery(level: float | None = 20.0, charging: bool | None = None) -> BatteryMonitor:
    monitor = BatteryMonitor()
    monitor.level, monitor.charging = level, charging
    return monitor


def charged(monitor: BatteryMonitor) -> bool:
    return (monitor.level or 0.0) >= 90.0


def run(monitor: BatteryMonitor, clock: Clock, **more: object) -> None:
    given = {'settle_seconds': 0.0, **more}
    charge(monitor, lambda: charged(monitor), clock, Interrupt(), **given)  # type: ignore[arg-type]


def test_a_battery_that_charges_by_itself_is_watched_until_it_is_enough() -> None:
    monitor = battery()
    clock = Clock(lambda: monitor.set_level(50.0), lambda: monitor.set_level(95.0))
    run(monitor, clock)
    assert clock.slept == [300.0, 300.0]
    assert monitor._watchers == [], 'nobody watches it any more'
    full = Clock()
    run(battery(90.0), full)
    assert full.slept == []


@pytest.mark.parametrize(('level', 'words'), [(20.0, '20 %'), (None, 'level unknown')])
def test_a_level_that_stalls_ends_a_charge(level: float | None, words: str) -> None:
    monitor = battery(level)
    with pytest.raises(CallError) as found:
        run(monitor, Clock(lambda: monitor.set_level(20.0) if level else None), stall_seconds=60.0)
    assert str(found.value).endswith(f'battery: still at {words} after 60 s')


def test_a_level_may_stall_for_ever_where_that_is_wanted() -> None:
    monitor = battery()
    clock = Clock(lambda: None, lambda: None, lambda: monitor.set_level(99.0))
    run(monitor, clock, stall_seconds=0.0)
    assert clock.slept == [1e6] * 3


def test_a_robot_that_is_not_at_a_station_is_told() -> None:
    with pytest.raises(CallError) as found:
        run(battery(charging=False), Clock())
    assert str(found.value).endswith(
        'battery: it is not charged (20 %): the robot is not at a station'
    )
    monitor = battery(charging=True)
    with pytest.raises(CallError, match='it is not charged'):
        run(monitor, Clock(lambda: monitor.set_charging(False)))


def test_a_charge_on_request_is_asked_for_again_when_its_contact_was_lost() -> None:
    monitor = battery()
    asked: list[bool] = []

    def recharge(off: Interrupt) -> None:
        asked.append(off.is_set())
        if len(asked) == 1:
            monitor.set_charging(False)
            assert off.is_set()
            monitor.set_charging(True)
            raise CallInterruptedError
        monitor.set_level(92.0)

    run(monitor, Clock(), recharge=recharge)
    assert asked == [False, False]
    short = battery(level=20.0)
    with pytest.raises(CallError, match=r'recharge: it ended at 60 %'):
        run(short, Clock(), recharge=lambda _: short.set_level(60.0))


def test_who_ends_a_mission_ends_a_charge() -> None:
    monitor, interrupt = battery(), Interrupt()
    interrupt.set()
    with pytest.raises(CallInterruptedError):
        charge(monitor, lambda: False, Clock(), interrupt, settle_seconds=0.0)

    def recharge(off: Interrupt) -> None:
        stop.set()
        assert off.is_set()
        raise CallInterruptedError

    stop = Interrupt()
    with pytest.raises(CallInterruptedError):
        charge(monitor, lambda: False, Clock(), stop, settle_seconds=0.0, recharge=recharge)
