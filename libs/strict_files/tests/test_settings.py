"""Fields of records say what they mean, and what they take."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from strict_files.settings import converted, names_expected, parameter, parameters


@dataclass(frozen=True)
class Limits:
    top: float = parameter(0.6, 'Top speed, m/s.', 0.0, 2.0)


@dataclass(frozen=True)
class Settings:
    limits: Limits = parameters(Limits, 'limits')
    marks: frozenset[int] = converted(frozenset, (1, 2, 2), 'Marks.', of=int)


def test_a_record_has_its_defaults_and_says_its_bounds() -> None:
    settings = Settings()
    assert (settings.limits.top, settings.marks) == (0.6, frozenset({1, 2}))
    (top,) = dataclasses.fields(Limits)
    assert top.metadata['parameter'] == {
        'default': 0.6,
        'description': 'Top speed, m/s.',
        'minimum': 0.0,
        'maximum': 2.0,
    }
    limits, marks = dataclasses.fields(Settings)
    assert limits.metadata['parameters'] == 'limits'
    assert marks.metadata['make'] is frozenset


def test_names_are_asked_for_where_there_are_none() -> None:
    assert names_expected(['a']) is None
    for bad in ([], ['']):
        assert names_expected(bad) == 'at least one name'
