"""What is made of observations: pictures that are kept, and doubts."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from indoor_watch import Event, EventBook, EvidenceStore, Kind, Observation, rule_from
from indoor_watch.alerting import SENT_WITHIN, Alerting
from indoor_watch.evidence import shows_nobody
from indoor_watch.visit import LidarSweep, Pictured, Visit

BARE = np.full((40, 60), 90, np.uint8)


class Alerted:
    """An alerting that keeps pictures, and whom it called."""

    def __init__(
        self, folder: Path, verify_seconds: float = 0.0, most: int = 10**9, **more: Any
    ) -> None:
        self.book, self.calls, self.warned = EventBook(), list[Event](), list[Event]()
        self.folder = folder
        self.alerting = Alerting(
            [rule_from({'door': 'all', 'is': 'open'}), rule_from({'person': 'nobody', **more})],
            self.book,
            local=lambda stamp: datetime.fromtimestamp(stamp, UTC),
            robot='R',
            tell=lambda _: None,
            alert=self.calls.append,
            warn=self.warned.append,
            store=EvidenceStore(folder, most),
            drawn=lambda _at, _visit: None,
            verify_seconds=verify_seconds,
        )

    def see(self, stamp: float, confidence: float = 0.9, door: str = 'D1', visit: int = 1) -> None:
        seen = Observation(Kind.DOOR, 'closed', 'R1', door, None, confidence, stamp)
        self.alerting.take([Pictured(seen, BARE)], Visit('R1', visit))

    def see_person(
        self,
        stamp: float,
        visit: int = 1,
        at: tuple[float, float] | None = None,
        sure: float = 0.82,
        sensor: str = 'camera',
    ) -> None:
        seen = Observation(Kind.PERSON, 'seen', 'E', '', None, sure, stamp, sensor=sensor)
        nothing = np.zeros((0, 2)), np.zeros(0, np.bool_), stamp
        sweep = None if at is None else LidarSweep(at, *nothing)
        self.alerting.take([Pictured(seen, BARE)], Visit('E', visit, sweep=sweep))

    def files(self) -> set[str]:
        return {each.name for each in self.folder.iterdir()}


def test_of_a_door_that_is_shut_for_hours_the_first_the_surest_and_the_last_picture_are_kept(
    tmp_path: Path,
) -> None:
    """They were 120 in 22 minutes."""
    alerted = Alerted(tmp_path)
    for number in range(120):
        alerted.see(1000.0 + 11.0 * number, 0.99 if number == 50 else 0.9, visit=number // 10)
    (event,) = alerted.book.events
    stamps = [int(each[2:15]) / 1000 for each in event.evidence]
    assert stamps == [1000.0, 1000.0 + 11.0 * 50, 1000.0 + 11.0 * 119]
    assert set(event.evidence) <= alerted.files()
    assert len(alerted.files()) <= 4 + SENT_WITHIN / 11.0


def test_the_picture_of_what_goes_on_is_not_deleted_for_that_of_another(tmp_path: Path) -> None:
    one = Alerted(tmp_path / 'size')
    one.see(1.0)
    size = sum(each.stat().st_size for each in (tmp_path / 'size').iterdir())
    alerted = Alerted(tmp_path / 'full', most=4 * size)
    alerted.see(1.0, door='D1')
    for number in range(20):
        alerted.see(2.0 + number, door='D2', visit=number)
    first, second = sorted(alerted.book.events, key=lambda each: each.subject)
    assert set(first.evidence) <= alerted.files()
    assert second.evidence[0] in alerted.files()


def test_pictures_are_their_owners_alone(tmp_path: Path) -> None:
    (tmp_path / 'open').mkdir(mode=0o755)
    alerted = Alerted(tmp_path / 'open')
    alerted.see(1.0)
    assert (tmp_path / 'open').stat().st_mode & 0o777 == 0o700
    assert [each.stat().st_mode & 0o777 for each in (tmp_path / 'open').iterdir()] == [0o600]


@pytest.mark.parametrize(('confidence', 'called'), [(0.97, 1), (0.8, 0)])
def test_what_is_not_sure_waits_for_a_second_look(
    tmp_path: Path, confidence: float, called: int
) -> None:
    alerted = Alerted(tmp_path, verify_seconds=20.0)
    alerted.see(1.0, confidence)
    assert len(alerted.calls) == called
    assert len(alerted.alerting.doubts(2.0)) == 1 - called
    alerted.see(3.0, confidence, visit=2)
    assert alerted.calls
    assert not alerted.alerting.doubts(4.0)


def test_a_person_in_one_picture_is_unverified_and_calls_nobody(tmp_path: Path) -> None:
    """Mail, webhook and MQTT told of a person in an empty corner, 0.82, camera alone."""
    alerted = Alerted(tmp_path, verify_seconds=20.0)
    alerted.see_person(1.0)
    assert len(alerted.alerting.doubts(20.0)) == 1
    assert alerted.alerting.doubts(22.0) == []
    assert (len(alerted.calls), len(alerted.warned)) == (0, 1)
    alerted.see_person(23.0)
    assert alerted.alerting.doubts(60.0) == []
    assert (len(alerted.calls), len(alerted.warned)) == (0, 1), 'told once'
    alerted.see_person(100.0, visit=2)
    assert len(alerted.calls) == 1, 'the second look says so, too'


def test_a_coat_that_looks_like_a_person_from_one_spot_calls_nobody(tmp_path: Path) -> None:
    """It does so in each picture from there, also after hours at the dock."""
    alerted = Alerted(tmp_path, verify_seconds=20.0)
    for number in range(50):
        alerted.see_person(10.0 * number, number // 12, (1.0, 2.0), 0.98)
        alerted.alerting.doubts(10.0 * number)
    assert (len(alerted.calls), len(alerted.warned)) == (0, 1)


@pytest.mark.parametrize(('at', 'sensor'), [((1.6, 2.0), 'camera'), ((1.0, 2.0), 'lidar')])
def test_a_person_who_is_seen_from_elsewhere_or_by_another_sensor_calls(
    tmp_path: Path, at: tuple[float, float], sensor: str
) -> None:
    alerted = Alerted(tmp_path, verify_seconds=20.0)
    alerted.see_person(1.0, 1, (1.0, 2.0))
    assert not alerted.calls
    alerted.see_person(5.0, 1, at, 0.96, sensor)
    assert len(alerted.calls) == 1


@pytest.mark.parametrize(('said', 'called', 'warned'), [('alert', 1, 0), ('warning', 0, 1)])
def test_a_rule_says_how_bad_one_picture_of_a_person_is(
    tmp_path: Path, said: str, called: int, warned: int
) -> None:
    alerted = Alerted(tmp_path, verify_seconds=20.0, unverified=said)
    alerted.see_person(1.0)
    kept = alerted.alerting.state()
    again = Alerted(tmp_path, verify_seconds=20.0, unverified=said)
    again.alerting.restore(kept)
    again.alerting.doubts(30.0)
    assert (len(again.calls), len(again.warned)) == (called, warned)
    assert f'unverified a{"n" if said == "alert" else ""} {said.upper()}' in (
        again.alerting.rules[1].words()
    )


def test_a_door_that_nobody_could_look_at_again_is_told_all_the_same(tmp_path: Path) -> None:
    alerted = Alerted(tmp_path, verify_seconds=20.0)
    alerted.see(1.0, 0.8)
    alerted.alerting.doubts(30.0)
    assert (len(alerted.calls), len(alerted.warned)) == (1, 0)


@pytest.mark.parametrize(
    ('rule', 'is_complete', 'blurs'),
    [({}, True, 1), ({}, False, 1), ({'pictures': 'sharp'}, True, 0)],
)
def test_people_in_kept_pictures_are_blurred_unless_the_rule_wants_them_sharp(
    tmp_path: Path, rule: dict[str, str], is_complete: bool, blurs: int
) -> None:
    asked = []

    def blur(picture: np.ndarray) -> tuple[np.ndarray, bool]:
        asked.append(picture.shape)
        return np.zeros_like(picture), is_complete

    alerting = Alerting(
        [rule_from({'person': 'nobody', **rule})],
        EventBook(),
        local=lambda stamp: datetime.fromtimestamp(stamp, UTC),
        robot='Robot1',
        tell=lambda _: None,
        alert=lambda _: None,
        store=EvidenceStore(tmp_path),
        drawn=lambda _at, _visit: None,
        verify_seconds=0.0,
        blur=blur,
    )
    seen = Observation(Kind.PERSON, 'seen', 'R1', confidence=0.9, stamp=10.0)
    alerting.take([Pictured(seen, np.full((40, 60, 3), 200, np.uint8))], Visit('R1', 1, 0.0))
    assert len(asked) == blurs
    (kept,) = tmp_path.iterdir()
    assert (cv2.imread(str(kept)).mean() < 50) == bool(blurs)
    # A sink blurs whatever was kept sharp, or without a look for persons.
    assert shows_nobody(kept.name) == bool(blurs and is_complete)
