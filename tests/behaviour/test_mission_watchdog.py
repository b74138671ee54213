"""A mission that does nothing says so, with the step that it waits for, and raises the alarm."""

from __future__ import annotations

from dataclasses import replace

from surveillance_behaviour.mission.mission_watchdog import PATIENCE, MissionSight, MissionWatchdog
from surveillance_behaviour.mission.recovery import Failure
from surveillance_runtime.incidents import Incidents, IncidentUpdate, Severity

MOVING = MissionSight(0.0, 'MOVE_TO_NEXT_ROOM', pose=(1.0, 2.0, 0.0), level=80.0, place='C1')


def watch(explained: float = 0.0) -> tuple[MissionWatchdog, list[IncidentUpdate]]:
    told: list[IncidentUpdate] = []
    return MissionWatchdog(Incidents(told.append), lambda _state: explained), told


def test_a_mission_that_stands_still_says_which_step_it_waits_for() -> None:
    watchdog, told = watch(30.0)
    for second in range(41):
        watchdog.look(replace(MOVING, now=float(second)))
    assert not told
    watchdog.look(replace(MOVING, now=41.0))
    assert told[0].severity is Severity.ALARM
    assert told[0].cause == ('robot', 'purpose')
    assert 'MOVE_TO_NEXT_ROOM: it waits for the end of the drive' in told[0].text
    watchdog.look(replace(MOVING, now=42.0))
    assert len(told) == 1
    watchdog.look(replace(MOVING, now=43.0, pose=(1.5, 2.0, 0.0)))
    assert told[1].over


def test_what_stops_the_mission_is_told_though_no_step_failed() -> None:
    watchdog, told = watch()
    watchdog.look(replace(MOVING, waiting='the machine broke: a mistake'))
    assert told[0].text == 'the robot waits for help in C1: the machine broke: a mistake'
    watchdog.look(replace(MOVING, now=1.0))
    assert told[1].over


def test_a_robot_that_creeps_moves() -> None:
    watchdog, told = watch()
    for second in range(100):
        pose = (0.01 * second, 0.0, 0.0)
        watchdog.look(replace(MOVING, now=float(second), pose=pose))
    assert not told


def test_where_the_robot_is_may_become_known_or_unknown_but_stay_so_only_for_a_while() -> None:
    watchdog, told = watch()
    for second in range(40):
        pose = None if second // 8 % 2 else MOVING.pose
        watchdog.look(replace(MOVING, now=float(second), pose=pose))
    assert not told
    for second in range(40, 60):
        watchdog.look(replace(MOVING, now=float(second), pose=None))
    assert len(told) == 1


def test_a_word_a_charge_and_a_pause_are_no_silence() -> None:
    watchdog, told = watch()
    still = replace(MOVING, state='RECHARGE_TASK')
    for second in range(60):
        step = {
            0: {'steps': second // 5},
            1: {'level': 20.0 + second},
            2: {'held': 'paused'},
        }[second // 20]
        watchdog.look(replace(still, now=float(second), **step))  # type: ignore[arg-type]
    assert not told


def test_few_looks_in_fast_time_are_no_silence() -> None:
    watchdog, told = watch()
    for look in range(10):
        watchdog.look(replace(MOVING, now=10.0 * look))
    assert not told
    watchdog.look(replace(MOVING, now=100.0 + PATIENCE))
    assert told


def test_a_paused_robot_whose_charge_falls_says_so_once_and_in_time() -> None:
    watchdog, told = watch()
    paused = replace(MOVING, held='paused')
    watchdog.look(paused)
    assert not told
    low = replace(paused, level=31.0, must_charge='the battery is at 31 %, below 33 %')
    for second in range(1, 20):
        watchdog.look(replace(low, now=float(second), level=31.0 - second))
    (only,) = told
    assert only.severity is Severity.ALARM
    assert only.text.startswith('the robot is paused in C1 and must charge now, at 30 %')
    watchdog.look(replace(low, now=30.0, held=''))
    assert told[1].over


def test_the_cause_of_the_failure_is_that_of_the_incident() -> None:
    for failure, closed, cause, words in (
        (Failure('choosing', 'nothing can be reached from R1'), ('D1',), ('door', 'D1'), 'D1 is'),
        (Failure('moving', 'x: aborted', 'R2'), (), ('place', 'R2'), 'x: aborted'),
        (Failure('recharging', 'not charged', 'E', charging=True), (), ('station', 'E'), 'not ch'),
        (
            Failure('moving', 'compute_path: nobody offers it', is_over=lambda: False),
            ('D1',),
            ('node', 'compute_path'),
            'nobody offers it',
        ),
    ):
        watchdog, told = watch()
        waits = replace(MOVING, waiting='for help', failure=failure, closed=closed)
        watchdog.look(waits)
        # Between two tries it is the same incident.
        watchdog.look(replace(waits, now=1.0, waiting=''))
        watchdog.look(replace(waits, now=2.0))
        assert [each.cause for each in told] == [cause]
        assert words in told[0].text
        watchdog.look(replace(MOVING, now=3.0))
        assert told[-1].over
        assert told[-1].cause == cause


def test_a_decision_to_stay_is_no_silence() -> None:
    watchdog, told = watch()
    still = replace(MOVING, state='CHOOSE_NEXT_ROOM', staying='robot2 goes first')
    for second in range(60):
        watchdog.look(replace(still, now=float(second)))
    assert not told
