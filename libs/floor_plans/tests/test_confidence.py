"""A door that is wide for the room behind it may be none."""

from __future__ import annotations

from floor_plans.map_rooms.confidence import DOUBTFUL, confidence


def test_a_door_is_as_sure_as_it_is_narrow_for_the_smaller_room() -> None:
    areas = {'office': 20.0, 'hall': 200.0, 'niche': 4.0}
    found = confidence(
        areas,
        {
            'door': (('office', 'hall'), 0.9),
            'opening': (('office', 'hall'), 3.0),
            'gap': (('niche', 'office'), 2.5),
        },
    )
    assert found['door'] > 0.95
    assert found['door'] > found['opening'] >= DOUBTFUL
    assert found['gap'] == 0.5
    assert found['niche'] == 0.5, 'as its least sure door'
    assert found['hall'] == 1.0, 'what is larger is not made doubtful'
