"""One loaded ontology without a service: its limits, what it takes back, its lock, its name."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armor_service import registry as registry_module
from armor_service.changes import AddAxiom, Change, RemoveAxiom, RemoveEntity, RenameEntity
from armor_service.protocol import DirectiveError
from armor_service.quarantine import Quarantine, Submission, TooHardError
from armor_service.reference import (
    LONG_BACKLOG,
    NOBODY,
    SLOW,
    Buffering,
    Effort,
    Limits,
    Origin,
    Reference,
)
from armor_service.registry import Registry
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import Axiom, ClassAssertion
from owl_reasoner.reasoner.budget import ReasoningBudgetError

X = 'http://x.org/o'


def fact(name: str, cls: str = 'K') -> ClassAssertion:
    return ClassAssertion(f'{X}#{cls}', f'{X}#{name}')


class Hard(KnowledgeBase):
    """Reasoning over it takes too long while an individual whose name begins with `hard` is in it.

    Attributes:
        asked: The seconds and the memory of each reasoning.
        fails: Errors of the next ones, whatever is in it; None: none.
    """

    def __init__(self, axioms: Iterable[Axiom] = ()) -> None:
        super().__init__(X, axioms)
        self.asked: list[tuple[float, float]] = []
        self.fails: list[ReasoningBudgetError | None] = []

    def reason(
        self, timeout: float = math.inf, *_: Any, memory: float = math.inf, **__: Any
    ) -> bool:
        self.asked.append((timeout, memory))
        error = self.fails.pop(0) if self.fails else None
        if error is None and any('#hard' in str(axiom) for axiom in self.axioms()):
            error = ReasoningBudgetError('seconds', 'it takes too long')
        if error is not None:
            raise error
        return super().reason()


def made(*present: Axiom, **settings: Any) -> tuple[Reference, Hard]:
    """Return a reference that was reasoned over, which takes no time."""
    kb = Hard(present)
    kb.reason()
    kb.asked.clear()
    return Reference('map', kb, Origin('', ''), **{'effort': Effort(base=2.0), **settings}), kb


def told(*changes: Change, client: str = 'me', time: float = 0.0) -> Submission:
    return Submission(client, time, changes)


def test_what_reasoning_may_take_grows_with_the_ontology_and_the_changes() -> None:
    assert Limits().of(3.0, 5) == math.inf
    assert Limits(0.5).of(0.0, 0) == 0.5
    assert Limits(0.5).of(2.0, 1000) == pytest.approx(0.5 + 40.0 + 0.2)


def test_a_directive_that_is_taken_back_is_named_with_who_and_when() -> None:
    adds = [AddAxiom(fact(name)) for name in 'abcde']
    time = datetime(2022, 5, 6, 7, 8, 9).timestamp()
    first = str(told(adds[0]))
    assert first.startswith('add ')
    assert first.endswith(" (of client 'me')")
    assert str(told(adds[0], time=time)).endswith(" (of client 'me', 2022-05-06 07:08:09)")
    assert str(told(*adds[:3])).count('add ') == 3
    assert ' more' not in str(told(*adds[:3]))
    assert str(told(*adds[:4])).count('add ') == 3
    assert ' and 1 more (of client' in str(told(*adds[:4]))
    assert ' and 2 more (of client' in str(told(*adds))


NAMES = ['a', 'b', 'hard1', 'hard2']
CHANGES = st.builds(
    lambda kind, name: kind(fact(name)),
    st.sampled_from([AddAxiom, RemoveAxiom]),
    st.sampled_from(NAMES),
)
DIRECTIVES = st.lists(st.lists(CHANGES, min_size=1, max_size=3), min_size=1, max_size=5)


@settings(max_examples=50)
@given(DIRECTIVES)
def test_only_the_directives_that_are_too_hard_are_taken_back(
    directives: list[list[Change]],
) -> None:
    base: set[Axiom] = {fact('a'), fact('kept')}
    ref, kb = made(*base)
    ref.buffering.reasoner = True
    undone: list[tuple[list[str], list[Change]]] = []
    completed: list[bool] = []
    ref.on_rolled_back = lambda lines, undo: undone.append((lines, undo))
    ref.on_completed = lambda: completed.append(True)
    every = [told(*changes, client=f'c{number}') for number, changes in enumerate(directives)]

    def after(state: set[Axiom], changes: Iterable[Change]) -> set[Axiom]:
        state = set(state)
        for change in changes:
            assert isinstance(change, AddAxiom | RemoveAxiom)
            (state.add if isinstance(change, AddAxiom) else state.discard)(change.axiom)
        return state

    def is_hard(state: set[Axiom]) -> bool:
        return any('#hard' in str(axiom) for axiom in state)

    whole = base
    for each in every:
        assert ref.submit(each) == ''
        whole = after(whole, each.changes)
    kept, gone = whole, list[Submission]()
    if is_hard(whole):
        kept = base
        for each in every:
            if is_hard(after(kept, each.changes)):
                gone.append(each)
            else:
                kept = after(kept, each.changes)
    lines = [f'{each}: it takes too long' for each in gone]
    answer = ref.reason()
    assert answer == '; '.join(lines)
    assert set(kb.axioms()) == kept
    assert (ref.quarantine.lines, ref.quarantine.count) == (lines, len(gone))
    assert (ref.quarantine.untested, ref.effort.backlog, ref.too_hard) == ([], 0, '')
    assert not kb.stale
    if gone:
        # Who keeps a journal of the directives undoes by this what was too hard.
        ((said, undo),) = undone
        assert said == lines
        assert after(whole, undo) == kept
        assert len(undo) == len(whole ^ kept)
    else:
        assert not undone
    assert completed in ([], [True])


def test_a_line_for_each_of_the_last_hundred_that_were_taken_back() -> None:
    ref, _ = made()
    for number in range(102):
        answer = ref.submit(told(AddAxiom(fact('hard')), client=f'c{number}'))
        assert f"'c{number}'" in answer
        assert ';' not in answer
    assert len(ref.quarantine.lines) == 100
    assert ref.quarantine.count == 102
    assert "'c2'" in ref.quarantine.lines[0]
    assert "'c101'" in ref.quarantine.lines[-1]


def test_reasoning_has_the_time_of_the_changes_or_of_all_where_nothing_is_known() -> None:
    limits = Limits(1.0, 5.0)
    ref, kb = made(*(fact(f'n{number}') for number in range(10)), effort=Effort(limits, base=2.0))
    ref.submit(told(AddAxiom(fact('a')), AddAxiom(fact('b'))))
    assert kb.asked == [(pytest.approx(1.0 + 40.0 + 0.0004), 5.0)]
    ref.submit(told(AddAxiom(fact('c'))))
    # What is asked for by REASON ends it sooner, not later.
    for asked in (0.25, 1e9):
        kb.change([fact(f'more{asked}')])
        ref.reason(asked)
    assert [seconds for seconds, _ in kb.asked[2:]] == [0.25, pytest.approx(41.0)]
    assert ref.effort.base == 2.0
    # The first time, and after a restart, all is new.
    for base, before in ((0.0, ()), (2.0, (fact('a'),))):
        ref, kb = made(
            *(fact(f'n{number}') for number in range(10)),
            effort=Effort(limits, base=base),
            quarantine=Quarantine(origin=before),
        )
        ref.submit(told(AddAxiom(fact('b'))))
        assert kb.asked[0][0] == pytest.approx(1.0 + 20.0 * base + 11 * 0.0002)
        assert (ref.effort.base == ref.effort.took) == (base == 0.0)
        assert ref.quarantine.origin == ()


def test_over_what_is_reasoned_is_told_before_and_its_end_after() -> None:
    ref, _ = made(buffering=Buffering(reasoner=True))
    places: list[int | None] = []
    ref.on_reasoning = places.append
    for name in ('a', 'hard', 'b'):
        ref.submit(told(AddAxiom(fact(name))))
    ref.reason()
    # All; without them; the first; the second, and without it; the third.
    assert [place for place in places if place is not None] == [-1, -1, 0, 1, -1, 2]
    assert places[1::2] == [None] * 6


@pytest.mark.parametrize('deaths', [1, 2])
def test_what_ended_the_process_twice_is_not_reasoned_over_again(deaths: int) -> None:
    ref, kb = made(buffering=Buffering(reasoner=True))
    ref.quarantine.deaths, ref.quarantine.died_at = deaths, 1
    for name in ('a', 'b', 'c'):
        ref.submit(told(AddAxiom(fact(name)), client=name))
    answer = ref.reason()
    why = 'the process ended 2 times while it reasoned over it'
    assert set(kb.axioms()) == {fact(name) for name in ('abc' if deaths == 1 else 'ac')}
    assert answer == ('' if deaths == 1 else f'{told(AddAxiom(fact("b")), client="b")}: {why}')
    assert ref.quarantine.deaths == 0


def error(limit: str) -> ReasoningBudgetError:
    return ReasoningBudgetError(limit, f'ended by {limit}')


def test_what_takes_too_long_without_the_changes_as_well_leaves_them_as_they_are() -> None:
    ref, kb = made(fact('a'))
    kb.fails = [error('seconds'), error('memory')]
    revision = ref.revision
    with pytest.raises(TooHardError, match='ended by memory'):
        ref.submit(told(AddAxiom(fact('b')), RemoveAxiom(fact('a'))))
    assert set(kb.axioms()) == {fact('b')}
    assert ref.too_hard == 'ended by memory'
    assert ref.is_slow
    assert ref.revision > revision
    assert (ref.quarantine.lines, ref.quarantine.count) == ([], 0)
    # Nothing is derived any more until somebody asks for it.
    reasoned = len(kb.asked)
    assert ref.submit(told(AddAxiom(fact('c')))) == ''
    assert len(kb.asked) == reasoned
    assert ref.reason() == ''
    assert ref.too_hard == ''
    assert set(kb.axioms()) == {fact('b'), fact('c')}


@pytest.mark.parametrize('when', [1, 2, 3])
def test_a_reasoning_that_is_cancelled_leaves_the_changes_as_they_are(when: int) -> None:
    """The first one, the one without the changes, or one over some of them."""
    ref, kb = made(buffering=Buffering(reasoner=True))
    for name in ('a', 'b'):
        ref.submit(told(AddAxiom(fact(name))))
    kb.fails = [*(error('seconds'), None, None)[: when - 1], error('cancelled')]
    with pytest.raises(TooHardError, match='ended by cancelled'):
        ref.reason()
    assert set(kb.axioms()) == {fact('a'), fact('b')}
    assert ref.too_hard == ''
    assert ref.quarantine.lines == []
    assert ref.reason() == ''


def test_a_time_of_ones_own_takes_nothing_back() -> None:
    ref, kb = made(buffering=Buffering(reasoner=True))
    ref.submit(told(AddAxiom(fact('hard'))))
    with pytest.raises(TooHardError, match='it takes too long'):
        ref.reason(0.5)
    assert set(kb.axioms()) == {fact('hard')}
    assert ref.quarantine.lines == []


def test_who_wishes_an_end_is_heard_once_but_for_what_was_dropped() -> None:
    for dropped in (False, True):
        ref, _ = made(dropped=dropped)
        ref.cancel.set()
        ref.submit(told(AddAxiom(fact('a'))))
        assert ref.cancel.is_set() == dropped
        ref.cancel.set()
        assert ref.explain(fact('a')) is not None
        assert ref.cancel.is_set() == dropped


def test_how_long_is_looked_for_an_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    ref, kb = made(fact('a'), effort=Effort(Limits(1.0, 5.0), base=2.0))
    asked: list[tuple[Any, ...]] = []

    def explain(*args: Any, memory: float) -> None:
        asked.append((*args, memory))
        raise error('seconds')

    monkeypatch.setattr(kb, 'explain', explain)
    monkeypatch.setattr(kb, 'explain_inconsistency', explain)
    for what in (fact('a'), None):
        with pytest.raises(TooHardError, match='ended by seconds'):
            ref.explain(what)
    seconds = pytest.approx(1.0 + 40.0 + 0.0002)
    assert asked == [(fact('a'), seconds, ref.cancel, 5.0), (seconds, ref.cancel, 5.0)]


def test_what_may_take_long_is_known_before() -> None:
    ref, _ = made()
    assert not ref.is_slow
    for attribute, plain, slow in (
        ('backlog', LONG_BACKLOG, LONG_BACKLOG + 1),
        ('took', SLOW, SLOW * 1.01),
        ('heavy', False, True),
        ('opened', True, False),
        ('too_hard', '', 'so long'),
    ):
        owner = ref.effort if hasattr(ref.effort, attribute) else ref
        setattr(owner, attribute, plain)
        assert not ref.is_slow
        setattr(owner, attribute, slow)
        assert ref.is_slow, attribute
        setattr(owner, attribute, plain)


def test_the_backlog_and_the_revision_count() -> None:
    ref, kb = made(buffering=Buffering(True, True))
    ref.submit(told(AddAxiom(fact('a')), AddAxiom(fact('b'))))
    ref.submit(told(AddAxiom(fact('c'))))
    assert (ref.effort.backlog, ref.revision, len(ref.buffering.queue)) == (3, 0, 3)
    assert ref.buffering.queue[0] == AddAxiom(fact('a'))
    ref.flush()
    revision = ref.revision
    assert revision > 0
    ref.flush()
    assert ref.revision == revision, 'nothing waited'
    ref.reason()
    assert ref.revision > revision
    revision = ref.revision
    ref.reason()
    assert ref.revision == revision, 'nothing was new'
    assert ref.effort.backlog == 0
    ref.submit(told(AddAxiom(fact('d'))))
    ref.buffer(True)
    assert fact('d') not in kb
    ref.buffer(False)
    assert fact('d') in kb


def test_what_is_not_there_to_go_is_named_unless_it_may_come_before() -> None:
    ref, _ = made(fact('a'))
    lost: list[Change] = [
        RemoveAxiom(fact('a')),
        RemoveAxiom(fact('b')),
        RenameEntity('class', f'{X}#OLD', f'{X}#K'),
        RenameEntity('class', f'{X}#K', f'{X}#NEW'),
        RemoveEntity('object_property', f'{X}#p'),
        RemoveEntity('individual', f'{X}#a'),
        AddAxiom(fact('c')),
    ]
    first, second, third = ref.missing(lost).split('; ')
    assert first.endswith(' was not asserted')
    assert 'b' in first
    assert second == f'map has no class <{X}#OLD>'
    assert third == f'map has no object property <{X}#p>'
    ref.buffering.manipulation = True
    ref.submit(told(AddAxiom(fact('b'))))
    assert ref.missing(lost) == ''


def test_an_ontology_of_before_is_reasoned_over_once_and_goes_on_where_that_fails() -> None:
    ref, kb = made(fact('a'), opened=False)
    kb.change([fact('b')])
    kb.fails = [error('cancelled')]
    with ref.held() as held:
        assert held is kb
    assert ref.opened
    with ref.held():
        pass
    assert len(kb.asked) == 1
    ref.dropped = True
    with pytest.raises(DirectiveError, match="'map' was dropped meanwhile"), ref.held():
        pass


def test_a_client_may_change_what_is_its_own_or_nobodys() -> None:
    ref, _ = made()
    assert ref.is_free_for('a')
    ref.mounted = 'b'
    assert not ref.is_free_for('a')
    assert ref.is_free_for('b')
    assert not ref.is_free_for(NOBODY)


def registered(*names: str) -> tuple[Registry, dict[str, Reference]]:
    registry, found = Registry(), {}
    for name in names:
        found[name] = Reference(name, KnowledgeBase(X, [fact('a'), fact('b')]), Origin('', ''))
        registry.add(found[name])
    return registry, found


def is_free(ref: Reference) -> bool:
    """Tell whether another thread could have the lock."""
    got: list[bool] = []

    def take() -> None:
        if ref.lock.acquire(blocking=False):
            got.append(True)
            ref.lock.release()

    thread = threading.Thread(target=take)
    thread.start()
    thread.join()
    return bool(got)


@contextmanager
def in_use(ref: Reference) -> Iterator[None]:
    """Have another thread hold the lock."""
    held, done = threading.Event(), threading.Event()

    def hold() -> None:
        with ref.lock:
            held.set()
            done.wait(60.0)

    thread = threading.Thread(target=hold)
    thread.start()
    held.wait(60.0)
    try:
        yield
    finally:
        done.set()
        thread.join()


def test_references_are_found_by_name_or_named() -> None:
    registry, found = registered('b', 'a')
    assert registry.names() == ['a', 'b']
    assert 'a' in registry
    assert 'c' not in registry
    assert registry.get('a') is registry.find('a') is found['a']
    assert registry.get('c') is None
    assert registry.hold_more_than(1)
    assert not registry.hold_more_than(2)
    for find in (registry.find, lambda name: registry.locked(name).__enter__()):
        with pytest.raises(DirectiveError) as unknown:
            find('c')
        assert str(unknown.value) == "unknown reference 'c'; loaded: 'a', 'b'"
    many, _ = registered(*(f'r{number:02}' for number in range(12)))
    with pytest.raises(DirectiveError) as unknown:
        many.find('c')
    assert "'r09'" in str(unknown.value)
    assert "'r10'" not in str(unknown.value)
    registry.remove(found['a'])
    assert found['a'].dropped
    assert registry.names() == ['b']
    with registry.locked_if_there('a') as none:
        assert none is None
    with registry.locked('b') as held:
        assert held is found['b']
        assert not is_free(held)
    assert is_free(found['b'])


def test_the_locks_of_a_batch_are_held_together_in_order() -> None:
    registry, found = registered('b', 'a', 'c')
    with registry.held(['b', 'x', 'a']) as held:
        assert [ref.name for ref in held] == ['a', 'b']
        assert [is_free(found[name]) for name in 'abc'] == [False, False, True]
    assert all(map(is_free, found.values()))


def test_all_are_held_or_none_where_one_is_in_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry_module, 'UNUSED_WITHIN', 0.01)
    monkeypatch.setattr(registry_module, 'AT_ONCE', 0.01)
    registry, found = registered('a', 'b')
    with registry.held_briefly() as held:
        assert [ref.name for ref in held] == ['a', 'b']
        assert not any(map(is_free, found.values()))
    assert all(map(is_free, found.values()))
    with in_use(found['b']):
        with registry.held_briefly() as held:
            assert held == []
        assert is_free(found['a'])
    # Somebody comes between the two looks.
    monkeypatch.setattr(registry_module, '_becomes_free', lambda _: True)
    with in_use(found['b']):
        with registry.held_briefly() as held:
            assert held == []
        assert is_free(found['a'])
    assert all(map(is_free, found.values()))


def test_one_that_is_in_use_for_a_moment_is_waited_for() -> None:
    registry, found = registered('a')
    ref = found['a']
    plain, held = ref.lock, threading.Event()
    waited_for = threading.Event()

    class Lock:
        """Whoever holds it gives it back as soon as somebody waits for it."""

        def acquire(self, timeout: float) -> bool:
            if timeout > 0.0:
                waited_for.set()
                user.join()
            return plain.acquire(timeout=timeout)

        def release(self) -> None:
            plain.release()

    def use() -> None:
        with plain:
            held.set()
            waited_for.wait(60.0)

    user = threading.Thread(target=use)
    user.start()
    held.wait(60.0)
    ref.lock = cast(Any, Lock())
    try:
        with registry.held_briefly() as all_of_them:
            assert [each.name for each in all_of_them] == ['a']
    finally:
        waited_for.set()
        user.join()


def test_what_is_too_hard_without_any_change_stays_as_it_is() -> None:
    ref, kb = made(fact('a'), opened=False)
    kb.change([fact('b')])
    kb.fails = [ReasoningBudgetError('seconds', 'it takes too long')]
    ref.open()
    assert set(kb.axioms()) == {fact('a'), fact('b')}
    assert ref.too_hard == 'it takes too long'
    assert ref.reason() == ''
    assert ref.too_hard == ''
    # Nor where the process ended over it.
    ref, kb = made(fact('a'))
    kb.change([fact('b')])
    ref.quarantine.deaths = 2
    with pytest.raises(TooHardError, match='the process ended 2 times'):
        ref.reason()
    assert set(kb.axioms()) == {fact('a'), fact('b')}
    assert ref.reason(5.0) == ''
    assert ref.quarantine.deaths == 0


def test_the_first_reasoning_of_a_process_has_the_time_of_all_axioms() -> None:
    kb = Hard(fact(f'n{number}') for number in range(10))
    limits = Limits(1.0, 5.0)
    ref = Reference('map', kb, Origin('', ''), effort=Effort(limits, base=2.0), opened=False)
    ref.open()
    assert kb.asked == [(pytest.approx(1.0 + 40.0 + 10 * 0.0002), 5.0)]
