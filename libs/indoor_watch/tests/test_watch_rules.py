"""What a person wants to know of, read from a file's list, said back, and applied."""

from __future__ import annotations

from datetime import datetime
from textwrap import indent

import pytest
import yaml

from indoor_watch import Kind, Level, Observation, read_watch_file, rule_from
from indoor_watch.watch_rules import severity_of
from strict_files.files import FileError

TEXT = """
- door: D1
  is: closed
  hours: 20:00-06:00
- person: nobody
  places: [R1, R2]
  hours: mon-fri 20:00-06:00
  persistence: 2 looks
- marker: 14
- object: none
  places: [C1]
  severity: notice
- light: off
  hours: daily 22:00-05:00
  severity: warning
"""
RULES = [rule_from(each) for each in yaml.safe_load(TEXT)]
NIGHT, DAY = datetime(2026, 11, 26, 23, 0), datetime(2026, 11, 26, 12, 0)


def level(seen: Observation, moment: datetime) -> int:
    return severity_of(RULES, seen, moment)[0]


def test_rules_are_said_back_in_words():
    words = [rule.words() for rule in RULES]
    assert words[0] == 'in the hours daily 20:00-06:00 door D1 not closed is an ALERT'
    assert words[1] == (
        'in the hours mon-fri 20:00-06:00 a person in R1 or R2, seen in 2 looks is an ALERT'
    )
    assert words[3] == 'always anything that was not there before in C1 is a NOTICE'
    assert words[4] == 'in the hours daily 22:00-05:00 the light not off is a WARNING'


def test_rules_hold_in_their_hours_and_places_and_for_what_is_sure():
    door = Observation(Kind.DOOR, 'ajar', 'C1', 'D1')
    assert (level(door, NIGHT), level(door, DAY)) == (Level.ALERT, 0)
    assert level(Observation(Kind.DOOR, 'closed', 'C1', 'D1'), NIGHT) == 0
    assert level(Observation(Kind.DOOR, 'open', 'C1', 'D2'), NIGHT) == 0
    person = Observation(Kind.PERSON, 'seen', 'R1', confidence=0.9)
    assert (level(person, NIGHT), level(person, DAY)) == (Level.ALERT, 0)
    for state in ('nobody', 'nobody walks'):
        assert level(Observation(Kind.PERSON, state, 'R1', confidence=0.9), NIGHT) == 0
    assert level(Observation(Kind.PERSON, 'seen', 'R1', confidence=0.3), NIGHT) == 0
    assert level(Observation(Kind.PERSON, 'seen', 'E', confidence=0.9), NIGHT) == 0
    assert level(Observation(Kind.OBJECT, 'appeared', 'C1'), DAY) == Level.NOTICE
    assert level(Observation(Kind.OBJECT, 'removed', 'C1'), DAY) == 0
    assert level(Observation(Kind.MARKER, 'missing', 'R1', '14'), DAY) == Level.ALERT
    assert level(Observation(Kind.MARKER, 'here', 'R1', '14'), DAY) == 0


def test_a_rule_waits_until_it_lasts():
    policy = RULES[1]
    assert not policy.lasting(looks=1, seconds=100.0)
    assert policy.lasting(looks=2, seconds=0.0)


@pytest.mark.parametrize(
    ('text', 'wrong'),
    [
        ('[D1]', "expected a mapping such as 'door: D1'"),
        ('dor: D1', "rules.odd.dor: unknown key, expected 'door'"),
        ('is: open', 'expected one of door, object'),
        ('door: D1\nis: opn', "door D1: got 'opn', expected 'open'"),
        ('door: D1', "door D1: got '', expected one of open, closed, ajar"),
        ('door: D9\nis: open', "there is no door 'D9'"),
        ('person: nobody\nplaces: [R9]', "there is no place 'R9'"),
        ('person: nobody\nhours: monday', "hours: 'monday' is no day"),
        ('person: nobody\nseverity: allert', "severity: got 'allert', expected 'alert'"),
        ('person: nobody\npersistence: long', "expected such as '2 looks' or '5 s'"),
        ('person: nobody\npersistence: 0 looks', 'expected 1 look or more'),
        ('person: nobody\nconfidence: sure', 'expected a number from 0 to 1'),
        ('person: nobody\nis: nobody', "person takes no 'is'"),
        ('door:\nis: open', "door: got None, expected the name of a door, or 'all'"),
        ('door: [D1, D2]\nis: open', "door: got ['D1', 'D2'], expected the name of a door"),
        ('door: D1\nis: open\nplaces: [R1]', "expected none beside 'door: D1'"),
        ('marker: m11', "marker: got 'm11', expected the number that a marker shows, or 'all'"),
        ('object: none\nplaces: []', 'places: got none, expected names'),
        ('person: everybody', "got 'everybody', expected one of nobody, usual"),
    ],
)
def test_mistakes_are_one_line_that_says_where_and_what_was_expected(tmp_path, text, wrong):
    path = tmp_path / 'watch.yaml'
    path.write_text('rules:\n  first: {door: D1, is: open}\n  odd:\n' + indent(text, '    '))
    with pytest.raises(FileError, match=r'watch.yaml:\d: rules.odd') as caught:
        read_watch_file(path, places=('R1', 'R2'), doors=('D1', 'D2'))
    assert wrong in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_file_of_rules_is_read_in_order(tmp_path):
    path = tmp_path / 'watch.yaml'
    path.write_text('rules:\n  door: {door: D1, is: open}\n  lamp: {light: off}\n')
    assert [(each.kind, each.wanted) for each in read_watch_file(path)] == [
        (Kind.DOOR, 'open'),
        (Kind.LIGHT, 'off'),
    ]
    path.write_text('rule:\n  door: {door: D1}\n')
    with pytest.raises(FileError, match="1: rule: unknown key, expected 'rules'"):
        read_watch_file(path)
