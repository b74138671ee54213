"""Changes on their way to subscribers, and the log of directives."""

from __future__ import annotations

import errno
import os
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armor_service import changes as changes_module
from armor_service.changes import (
    AddAxiom,
    Change,
    ChangeFeed,
    NumberedChange,
    RemoveAxiom,
    RemoveEntity,
    RenameEntity,
    SetAssertion,
    apply_all,
    change_text,
)
from armor_service.directive_log import DirectiveLog
from armor_service.facts import ShortFact
from armor_service.protocol import DirectiveError, DirectiveRequest, DirectiveResponse
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
    SubClassOf,
)
from owl_reasoner.owl.expressions import Literal

X = 'http://x.org/#'
ROOM = ClassAssertion(X + 'ROOM', X + 'R1')
DOOR = ObjectPropertyAssertion(X + 'hasDoor', X + 'R1', X + 'D1')
BELOW = SubClassOf(X + 'ROOM', X + 'LOCATION')


def changed(*added: Axiom, removed: tuple[Axiom, ...] = (), consistent: bool = True) -> Changes:
    return Changes(
        1, tuple((a, False) for a in added), tuple((a, True) for a in removed), consistent
    )


def test_changes_of_all_references_are_numbered_until_they_are_taken() -> None:
    told: list[int] = []
    feed = ChangeFeed(lambda: told.append(len(told)))
    feed.note('map', None)
    feed.note('map', changed(ROOM))
    feed.note('other', changed(DOOR, removed=(ROOM,), consistent=False))
    feed.note('map', changed(BELOW))
    assert told == [0], 'announced once while something waits'
    assert feed.take() == [
        NumberedChange('map', 0, (), (), False),
        NumberedChange('map', 2, ((ROOM, False),), (), True),
        NumberedChange('other', 3, ((DOOR, False),), ((ROOM, True),), False),
        NumberedChange('map', 4, ((BELOW, False),), (), True),
    ]
    assert feed.take() == []
    feed.note('map', changed(ROOM))
    assert told == [0, 1]
    assert [each.sequence for each in feed.take()] == [5]
    for load in (None, None):
        feed.note('map', load)
    feed.note('map', changed(BELOW))
    assert [each.sequence for each in feed.take()] == [0, 0, 8], 'who missed a load sees a gap'
    feed.note('map', None)
    feed.note('map', changed(ROOM))
    assert [each.sequence for each in feed.take()] == [0, 10]


def test_a_change_that_is_too_large_leaves_a_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(changes_module, 'LARGE', 2)
    feed = ChangeFeed(lambda: None)
    feed.note('map', changed(ROOM, removed=(DOOR,)))
    feed.note('map', changed(ROOM, BELOW, removed=(DOOR,)))
    feed.note('map', changed(BELOW))
    assert [(each.sequence, len(each.added), len(each.removed)) for each in feed.take()] == [
        (1, 1, 1),
        (3, 0, 0),
        (4, 1, 0),
    ]


def test_facts_of_a_change_went_and_came() -> None:
    change = NumberedChange(
        'map',
        1,
        [(ROOM, True), (BELOW, False)],
        [(DOOR, False), (DataPropertyAssertion(X + 'now', X + 'R1', Literal('5')), True)],
        True,
    )
    assert change.facts() == [
        (ShortFact('hasDoor', ('R1', 'D1')), False, False),
        (ShortFact('now', ('R1', '"5"^^xsd:string')), False, True),
        (ShortFact('ROOM', ('R1',)), True, True),
    ]


NAMES = [X + name for name in ('R1', 'R2', 'R3')]
CHANGES: list[Change] = [
    *(kind(ClassAssertion(X + 'ROOM', name)) for kind in (AddAxiom, RemoveAxiom) for name in NAMES),
    *(
        kind(ObjectPropertyAssertion(X + 'isIn', X + 'Robot1', name))
        for kind in (AddAxiom, SetAssertion)
        for name in NAMES
    ),
    RenameEntity('individual', NAMES[0], NAMES[1]),
    RemoveEntity('individual', NAMES[2]),
]


@settings(max_examples=60)
@given(st.lists(st.sampled_from(CHANGES), max_size=10))
def test_changes_in_one_batch_come_to_what_they_come_to_one_by_one(steps: list[Change]) -> None:
    together, apart = KnowledgeBase('x:'), KnowledgeBase('x:')
    apply_all(together, steps)
    for change in steps:
        apply_all(apart, [change])
    assert set(together.axioms()) == set(apart.axioms())
    held: set[Axiom] = set()
    for change in steps:
        if isinstance(change, AddAxiom):
            held.add(change.axiom)
        elif isinstance(change, RemoveAxiom):
            held.discard(change.axiom)
        elif isinstance(change, SetAssertion):
            prop, subject = change.axiom.prop, change.axiom.subject
            held = {
                a
                for a in held
                if (getattr(a, 'prop', ''), getattr(a, 'subject', '')) != (prop, subject)
            }
            held.add(change.axiom)
        else:
            return
    assert set(together.axioms()) == held


def test_changes_are_written_as_people_do() -> None:
    assert change_text(RenameEntity('individual', X + 'R1', X + 'R2')) == (
        f'rename <{X}R1> to <{X}R2>'
    )
    assert change_text(RemoveEntity('class', X + 'ROOM')) == f'remove <{X}ROOM>'
    assert change_text(AddAxiom(ROOM)).startswith('add ')
    assert change_text(RemoveAxiom(ROOM)).startswith('remove ')
    assert change_text(SetAssertion(DOOR)).startswith('set ')


def logged(log: DirectiveLog, *args: str, loaded: bool = True, **answer: object) -> None:
    request = DirectiveRequest('me', 'map', 'ADD', 'IND', 'CLASS', args)
    response = DirectiveResponse(**answer)  # type: ignore[arg-type]
    log.write(request, response, is_loaded=loaded)


def test_a_line_has_who_asked_what_and_the_answer() -> None:
    lines: list[str] = []
    log = DirectiveLog(lines.append)
    assert not log.enabled
    logged(log, 'R1')
    assert lines == []
    log.on_screen = True
    assert log.enabled
    logged(log, 'R1', 'ROOM', is_consistent=True)
    logged(log, 'R1', is_consistent=False)
    logged(log, 'R1', is_consistent=False, loaded=False)
    logged(log, 'R1', success=False, exit_code=205, error_description='no', is_consistent=True)
    logged(log, 'R1', is_consistent=True, queried_objects=['a', 'b\nc'])
    logged(log, *map(str, range(20)), is_consistent=True)
    logged(log, *map(str, range(21)), is_consistent=True)
    begin = "'me' on 'map': ADD IND CLASS "
    assert lines == [
        begin + '[R1, ROOM] -> ok',
        begin + '[R1] -> ok (inconsistent)',
        begin + '[R1] -> ok',
        begin + '[R1] -> exit code 205: no',
        begin + r"[R1] -> ok ['a', 'b\\nc']",
        begin + f'[{", ".join(map(str, range(20)))}] -> ok',
        begin + f'[{", ".join(map(str, range(20)))}, ... (21 arguments)] -> ok',
    ]
    logged(log, 'x' * 201, is_consistent=True, queried_objects=['y'] * 30)
    assert 'x' * 197 + '...' in lines[-1]
    assert lines[-1].count("'y'") == 20


def test_lines_of_a_file_have_their_time_and_one_file_is_written_at_a_time(tmp_path: Path) -> None:
    log = DirectiveLog(lambda _: None)
    log.open(tmp_path / 'one.log')
    assert log.enabled
    before = datetime.now(UTC)
    logged(log, 'R1', is_consistent=True)
    log.open(tmp_path / 'two.log')
    logged(log, 'R2', is_consistent=True)
    log.close()
    assert not log.enabled
    logged(log, 'R3', is_consistent=True)
    (one,) = (tmp_path / 'one.log').read_text().splitlines()
    stamp, _, rest = one.partition(' ')
    assert abs((datetime.fromisoformat(stamp) - before).total_seconds()) < 600.0
    assert rest == "'me' on 'map': ADD IND CLASS [R1] -> ok"
    assert '[R2]' in (tmp_path / 'two.log').read_text()
    (tmp_path / 'link.log').symlink_to(tmp_path / 'one.log')
    for wrong, words in (('link.log', 'link'), ('no/such.log', 'No such file'), ('.', 'directory')):
        with pytest.raises(DirectiveError, match=words):
            log.open(tmp_path / wrong)
    os.mkfifo(tmp_path / 'pipe.log')
    reading = os.open(tmp_path / 'pipe.log', os.O_RDONLY | os.O_NONBLOCK)
    with pytest.raises(DirectiveError, match='expected a file'):
        log.open(tmp_path / 'pipe.log')
    os.close(reading)


def test_a_file_is_closed_at_its_size_and_where_it_takes_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[str] = []
    one = len(
        datetime.now(UTC).isoformat(timespec='milliseconds')
        + " 'me' on 'map': ADD IND CLASS [R1] -> ok\n"
    )
    log = DirectiveLog(lines.append, max_bytes=2 * one)
    log.open(tmp_path / 'a.log')
    logged(log, 'R1', is_consistent=True)
    assert log.enabled
    logged(log, 'R1', is_consistent=True)
    assert lines == [f'directive log: {2 * one} bytes are reached; the log file is closed']
    assert not log.enabled
    assert (tmp_path / 'a.log').stat().st_size == 2 * one

    class Full:
        def __init__(self, file: object, answer: object) -> None:
            self.answer = answer

        def write(self, data: bytes) -> int:
            if isinstance(self.answer, OSError):
                raise self.answer
            return len(data) - 1

        def close(self) -> None: ...

    for answer in (OSError(errno.EIO, 'Input/output error'), 'part'):
        lines.clear()
        log.open(tmp_path / 'b.log')
        monkeypatch.setattr(log, '_file', Full(None, answer))
        logged(log, 'R1', is_consistent=True)
        reason = 'Input/output error' if answer != 'part' else 'No space left on device'
        assert lines == [f'directive log: {reason}; the log file is closed']
        assert not log.enabled
