"""What settings there are, what they are where nobody says otherwise, and what they take."""

from __future__ import annotations

from dataclasses import fields

import pytest

from marker_detection import DetectorSettings, StreamSettings
from marker_detection.detector import odd_numbers

NUMBERS = {
    'bridges': ((5,), 2, 99),
    'contrast': (7.0, 1.0, 100.0),
    'min_length': (8.0, 4.0, 1000.0),
    'max_outlines': (250, 1, 100000),
    'max_candidates': (1000, 1, 100000),
    'blur': (0.8, 0.0, 5.0),
    'least_correlation': (0.85, 0.0, 1.0),
    'least_inner_correlation': (0.8, 0.0, 1.0),
    'known_lead': (2.6, 1.0, 100.0),
    'unknown_lead': (3.0, 1.0, 100.0),
    'border': (1, 1, 4),
    'size': (0.2, 0.001, 100.0),
    'known_frames': (2, 1, 100),
    'unknown_frames': (4, 1, 100),
}
"""Default and bounds of each setting that has some."""
OTHERS = {
    'dictionary': 'DICT_5X5_100',
    'windows': (15, 31, 5),
    'known_ids': [],
    'sizes': [],
    'inverted': False,
}


def declared():
    return {
        each.name: each.metadata['parameter']
        for record in (DetectorSettings, StreamSettings)
        for each in fields(record)
        if 'parameter' in each.metadata
    }


def test_settings_have_their_defaults_and_bounds():
    found = {
        name: (spec['default'], spec.get('minimum'), spec.get('maximum'))
        for name, spec in declared().items()
    }
    assert found == NUMBERS | {name: (default, None, None) for name, default in OTHERS.items()}
    records = (DetectorSettings(), StreamSettings())
    for name, (default, *_) in NUMBERS.items():
        assert [getattr(each, name) for each in records if hasattr(each, name)] == [default]
    assert (records[0].known_ids, records[1].sizes) == (None, {})
    assert records[1].detector == records[0]


@pytest.mark.parametrize('values', [[3], [15, 31, 5], (3, 3)])
def test_sides_of_neighbourhoods_are_odd_numbers(values):
    assert odd_numbers(values) is None
    assert DetectorSettings(windows=tuple(values)).windows == tuple(values)


@pytest.mark.parametrize('values', [[], [1], [4], [15, 2], [-3], [9, 1]])
def test_other_sides_of_neighbourhoods_are_refused(values):
    assert odd_numbers(values) == 'odd numbers from 3'
    with pytest.raises(ValueError, match=r'^windows must be odd and at least 3, got \['):
        DetectorSettings(windows=tuple(values))


def test_gaps_to_close_are_two_pixels_at_least():
    assert DetectorSettings(bridges=(2, 9)).bridges == (2, 9)
    assert DetectorSettings(bridges=()).bridges == ()
    with pytest.raises(ValueError, match=r'^bridges must be at least 2 pixels, got \[5, 1\]$'):
        DetectorSettings(bridges=(5, 1))
