"""Markers that fit, are missing, double, wrong or contradict each other."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_behaviour.map_from_markers.assembly import PlaceNote, Survey
from surveillance_behaviour.map_from_markers.initial_scan import InitialScan
from surveillance_perception.marker_registry import read_registry

REGISTRY = read_registry(Path(__file__).parents[2] / 'config' / 'markers.yaml')
NOTES = {
    marker_id: PlaceNote(place.room, (place.x, place.y), place.connections)
    for marker_id, place in REGISTRY.items()
}


def survey_of(ids, robot_room='E', **changed):
    survey = Survey(robot_room)
    for marker_id in ids:
        survey.note(marker_id, changed.get(f'm{marker_id}', NOTES[marker_id]))
    return survey


def rooms(report):
    return sorted(place.room for place in report.places)


def test_all_markers_make_the_whole_map():
    report = survey_of(range(11, 18)).report()
    assert report.complete
    assert rooms(report) == ['C1', 'C2', 'E', 'R1', 'R2', 'R3', 'R4']
    doors = {place.room: dict(place.connections) for place in report.places}
    assert doors['C1'] == {'D5': 'E', 'D7': 'C2', 'D1': 'R1', 'D2': 'R2'}
    assert report.sentences() == []


@pytest.mark.parametrize('left_out', range(12, 18))
def test_missing_marker_is_named_with_the_doors_that_lead_there(left_out):
    report = survey_of(set(range(11, 18)) - {left_out}).report()
    room = NOTES[left_out].room
    assert not report.complete
    assert set(report.missing) == {room}
    assert report.missing[room] == tuple(sorted(NOTES[left_out].connections))
    assert room not in rooms(report)
    assert any(f'no marker tells of {room}' in sentence for sentence in report.sentences())


def test_doors_to_what_is_missing_are_not_in_the_map():
    report = survey_of([11, 12, 13, 15, 16, 17]).report()
    c1 = next(place for place in report.places if place.room == 'C1')
    assert dict(c1.connections) == {'D5': 'E', 'D7': 'C2', 'D2': 'R2'}


def test_rooms_behind_a_missing_corridor_are_cut_off():
    report = survey_of([11, 13, 14, 15, 16, 17]).report()
    assert rooms(report) == ['C2', 'E', 'R3', 'R4']
    assert report.cut_off == ('R1', 'R2')


def test_second_marker_that_tells_the_same_changes_nothing():
    survey = survey_of(range(11, 18))
    survey.note(40, NOTES[14])
    assert survey.report().complete


def test_markers_that_put_a_place_apart_contradict():
    survey = survey_of(range(11, 18))
    survey.note(40, PlaceNote('R1', (5.0, 5.0), NOTES[14].connections))
    report = survey.report()
    assert report.contradictions == ('markers 14 and 40 put R1 apart',)
    assert 'R1' in rooms(report)


def test_door_that_the_other_side_does_not_know_is_not_used():
    wrong = PlaceNote('R1', (-7.0, 3.0), {'D9': 'C1'})
    report = survey_of(range(11, 18), m14=wrong).report()
    assert 'R1 has D9 to C1, but C1 has no D9' in report.contradictions
    assert 'R1' not in rooms(report)
    assert report.cut_off == ('R1',)


def test_door_that_leads_elsewhere_from_the_other_side_is_not_used():
    wrong = PlaceNote('C2', (3.5, 0.0), {'D6': 'E', 'D7': 'R1', 'D3': 'R3', 'D4': 'R4'})
    report = survey_of(range(11, 18), m13=wrong).report()
    assert any(sentence.startswith('D7 leads from C1 to C2') for sentence in report.contradictions)
    c1 = next(place for place in report.places if place.room == 'C1')
    assert 'D7' not in c1.connections


def test_door_in_three_places_is_not_used():
    wrong = PlaceNote('R2', (-7.0, -4.0), {'D1': 'C1', 'D2': 'C1'})
    report = survey_of(range(11, 18), m15=wrong).report()
    assert any('D1 cannot be in' in sentence for sentence in report.contradictions)
    assert 'R1' not in rooms(report)
    assert 'R2' in rooms(report)


def test_robot_is_in_the_nearest_place_when_it_is_not_told():
    survey = survey_of(range(11, 18), robot_room='')
    assert survey.report().robot_room == ''
    assert not survey.report().places
    survey.robot_position = (8.0, -4.0)
    assert survey.report().robot_room == 'R4'


def test_nothing_can_be_patrolled_while_the_robots_place_is_unknown():
    report = survey_of([12, 14]).report()
    assert not report.places
    assert 'no marker tells of the place where the robot is' in report.sentences()


class ScriptedCamera:
    """Shows given ids at each pose and scan."""

    def __init__(self, survey, by_pose, by_scan=(), seconds=3.0, rate=1.0):
        self.survey, self.by_pose, self.by_scan = survey, by_pose, list(by_scan)
        self.time, self.seconds, self.rate = 0.0, seconds, rate
        self.did = []

    def _show(self, ids):
        self.time += self.seconds
        for marker_id in ids:
            self.survey.note(marker_id, NOTES[marker_id])

    def pose(self, number):
        self.did.append(number)
        self._show(self.by_pose.get(number, ()))

    def scan(self, overlap, reach, dwell, done):
        self.did.append(('scan', round(overlap, 2), round(reach, 2), dwell))
        self._show(self.by_scan.pop(0) if self.by_scan else ())

    def home(self):
        self.did.append('home')


def look(camera, deadline=30.0):
    said = []
    looking = InitialScan(deadline=deadline, dwell=0.5)
    report = looking.run(
        camera,
        camera.survey.report,
        lambda: camera.time,
        said.append,
        lambda: False,
        real=lambda: camera.time / camera.rate,
    )
    return report, said


def test_looking_ends_as_soon_as_all_is_found():
    camera = ScriptedCamera(Survey('E'), {1: range(11, 15), 2: range(15, 18)})
    report, said = look(camera)
    assert report.complete
    assert camera.did == [1, 2, 'home']
    assert said == []


def test_looking_goes_on_closer_for_what_is_missing():
    camera = ScriptedCamera(Survey('E'), {1: range(11, 17)}, by_scan=[(), (17,)])
    report, said = look(camera)
    assert report.complete
    assert camera.did == [1, 2, 3, 4, ('scan', 0.12, 0.3, 0.5), ('scan', 0.24, 0.45, 1.0), 'home']
    assert said[0] == 'looking on: no marker tells of R4, to which D4 leads'


def test_after_the_deadline_what_was_found_has_to_do():
    camera = ScriptedCamera(Survey('E'), {1: range(11, 17)})
    report, _ = look(camera)
    assert rooms(report) == ['C1', 'C2', 'E', 'R1', 'R2', 'R3']
    assert set(report.missing) == {'R4'}
    assert camera.time < 40.0


def test_the_deadline_does_not_end_the_first_look_all_around():
    found = {1: (11, 12)}, [range(13, 17)]
    camera = ScriptedCamera(Survey('E'), *found, seconds=200.0, rate=10.0)
    report, _ = look(camera, deadline=45.0)
    assert rooms(report) == ['C1', 'C2', 'E', 'R1', 'R2', 'R3']
    assert camera.did == [1, 2, 3, 4, ('scan', 0.12, 0.3, 0.5), 'home']


@pytest.mark.parametrize('rate', [1.0, 10.0])
def test_an_arm_that_does_not_answer_holds_the_first_look_up_for_two_deadlines_at_most(rate):
    camera = ScriptedCamera(Survey('E'), {1: (11, 12)}, seconds=30.0 * rate, rate=rate)
    report, _ = look(camera, deadline=30.0)
    assert report.places
    assert camera.did == [1, 2, 'home']


def test_without_anything_to_patrol_looking_does_not_end_at_the_deadline():
    camera = ScriptedCamera(Survey('E'), {}, by_scan=[(), (), (), (), (), (), (), (11, 12)])
    report, said = look(camera, deadline=10.0)
    assert rooms(report) == ['C1', 'E']
    assert said.count('nothing to patrol was found yet; looking on') == 1
