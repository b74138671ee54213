"""What the observer tells comes back as it was, and what the behaviour reads is what was meant."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from rclpy.serialization import deserialize_message, serialize_message

from indoor_watch import Coverage, Event, EventState, Kind, Observation
from indoor_watch.marker_checks import MarkerCheck
from surveillance_behaviour.conversions import (
    checks_from,
    doubts_from,
    pictures_from,
    viewpoints_from,
)
from surveillance_behaviour.ports import Check, Doubt
from surveillance_perception.observing.conversions import (
    checks_to_ros,
    coverage_from_ros,
    coverage_to_ros,
    doubts_to_ros,
    event_from_ros,
    event_to_ros,
    observation_from_ros,
    observation_to_ros,
    pictures_to_ros,
    viewpoints_to_ros,
)

EVENT = Event(
    3,
    Kind.DOOR,
    'ajar',
    'C1',
    'D1',
    (1.5, -2.25),
    3,
    'D1 is shut',
    EventState.ACKNOWLEDGED,
    1_700_000_000.5,
    1_700_000_060.25,
    12,
    2,
    0.96,
    ('a', 'b'),
    ('3_1.jpg', '3_2.jpg'),
    '3',
    (0.0, 1.0),
    True,
    ('lidar',),
)


def sent(message):
    return deserialize_message(serialize_message(message), type(message))


@pytest.mark.parametrize('kind', list(Kind))
def test_an_observation_of_each_kind_and_state_comes_back_as_it_was(kind):
    bare = Observation(kind, kind.states[0], 'R1')
    for seen in (
        bare,
        replace(
            bare, subject='D1', position=(1.5, 2.5), confidence=0.25, stamp=1_700_000_000.125,
            robot='a', evidence='3_1.jpg', compared_with='7', seen_from=(0.5, -1.0), usual=0.75,
            sensor='lidar',
        ),
        *(replace(bare, state=state) for state in kind.states),
    ):  # fmt: skip
        assert observation_from_ros(sent(observation_to_ros(seen))) == seen


def test_an_event_comes_back_as_it_was():
    bare = replace(EVENT, position=None, seen_from=None, evidence=(), sensors=(), subject='')
    for event in (EVENT, bare, *(replace(EVENT, state=state) for state in EventState)):
        assert event_from_ros(sent(event_to_ros(event))) == event


@pytest.mark.parametrize('field', ['kind', 'state'])
def test_an_event_of_another_version_is_refused(field):
    message = event_to_ros(EVENT)
    setattr(message, field, 'dream')
    with pytest.raises(ValueError, match='dream'):
        event_from_ros(message)


def test_what_a_visit_saw_comes_back_as_it_was():
    known = Coverage('R1', 10.0, 20.5, 0.75, 3.5, 7, 0.5)
    assert coverage_from_ros(sent(coverage_to_ros(known))) == known
    unknown = coverage_from_ros(sent(coverage_to_ros(replace(known, share=math.nan))))
    assert math.isnan(unknown.share)


def test_the_behaviour_reads_from_where_to_look_and_at_what():
    told = {'R1': [(1.5, 2.0), (3.0, 4.0)], 'C1': []}
    assert viewpoints_from(sent(viewpoints_to_ros(told))) == {
        'R1': [(1.5, 2.0, 0.0), (3.0, 4.0, 0.0)], 'C1': [],
    }  # fmt: skip
    checks = [MarkerCheck('marker 21', 'C1', (1.004, 2.0), None, is_open=True)]
    checks += [MarkerCheck('marker 22', 'C1', (3.0, 2.0), (3.0, 1.0))]
    assert checks_from(sent(checks_to_ros(checks))) == {
        'C1': [
            Check('marker 21', (1.0, 2.0, 0.0), None, True),
            Check('marker 22', (3.0, 2.0, 0.0), (3.0, 1.0, 0.0)),
        ]
    }
    bare = replace(EVENT, position=None)
    assert doubts_from(sent(doubts_to_ros([(EVENT, (0.5, 0.5)), (bare, None)]))) == [
        Doubt(3, 'C1', (0.5, 0.5, 0.0), (1.5, -2.25, 0.0)),
        Doubt(3, 'C1'),
    ]


def test_the_behaviour_reads_which_pictures_were_looked_at():
    looked = [(5.25, math.pi), (6.0, None)]
    assert pictures_from(sent(pictures_to_ros(looked, 1.0, camera=True))) == (looked, 1.0)
    assert pictures_from(sent(pictures_to_ros([], None, camera=True))) == ([], None)
    assert pictures_from(sent(pictures_to_ros([], None, camera=False))) == (None, None)


def test_a_place_that_is_no_number_is_refused():
    message = checks_to_ros([MarkerCheck('marker 21', 'C1', (1.0, 2.0), None)])
    message.checks[0].at.x = math.nan
    with pytest.raises(ValueError, match='finite'):
        checks_from(message)
