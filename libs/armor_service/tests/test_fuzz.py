"""Random directives against a model in a few lines of plain Python, with restarts in between.

The default run is short and repeatable; ``-m long`` searches for longer.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from armor_service.access import Settings
from armor_service.directives.table import TABLE
from armor_service.protocol import DirectiveRequest, DirectiveResponse
from armor_service.service import ArmorService
from armor_service.store.store import Store

from .seven_rooms import FIXTURES

BASE = 'http://example.org/four'
INDIVIDUALS = st.sampled_from(['a', 'b', 'c', f'<{BASE}#a>'])
CLASSES = st.sampled_from(['K', 'L', 'M'])
PROPS = st.sampled_from(['p', 'q'])
DATA = st.sampled_from(['d', 'e'])
VALUES = st.sampled_from(['1', '2', '"1"^^xsd:long', 'x'])
CLIENTS = st.sampled_from(['one', 'two'])
REFERENCES = st.sampled_from(['r', 's'])


def bare(name: str) -> str:
    return name.removeprefix(f'<{BASE}#').removesuffix('>')


class Model:
    """What one reference holds, as sets of tuples."""

    def __init__(self, buffered: bool) -> None:
        self.facts: set[tuple[str, ...]] = set()
        self.queue: list[tuple[str, tuple[str, ...]]] = []
        self.buffered = buffered
        self.mounted = 'none'

    def submit(self, changes: Sequence[tuple[str, tuple[str, ...]]]) -> None:
        self.queue += changes
        if not self.buffered:
            self.flush()

    def flush(self) -> None:
        for what, fact in self.queue:
            if what == 'add':
                self.facts.add(fact)
            elif what == 'remove':
                self.facts.discard(fact)
            elif what == 'rename':
                old, new = fact
                self.facts = {
                    (f[0], f[1], *(new if part == old else part for part in f[2:]))
                    if f[0] in ('type', 'object')
                    else (*f[:2], new if f[2] == old else f[2], *f[3:])
                    if f[0] == 'data'
                    else f
                    for f in self.facts
                }
            else:
                (gone,) = fact
                self.facts = {
                    f
                    for f in self.facts
                    if not (f[0] in ('type', 'object') and gone in f[2:])
                    and not (f[0] == 'data' and f[2] == gone)
                }
        self.queue = []

    def types(self, ind: str) -> set[str]:
        found = {f[1] for f in self.facts if f[0] == 'type' and f[2] == ind}
        while True:
            more = {f[2] for f in self.facts if f[0] == 'sub' and f[1] in found} - found
            if not more:
                return found
            found |= more

    def instances(self, cls: str) -> set[str]:
        return {f[2] for f in self.facts if f[0] == 'type' and cls in self.types(f[2])}


class Directives(RuleBasedStateMachine):
    """Sends directives to a durable service and to the model."""

    def __init__(self) -> None:
        super().__init__()
        self.directory = Path(tempfile.mkdtemp(prefix='armor-fuzz-'))
        self.models: dict[str, Model] = {}
        self.start()

    def start(self) -> None:
        store = Store(self.directory / 'store')
        limits = Settings(ontologies_folder=self.directory, read_only_directories=(FIXTURES,))
        self.service = ArmorService(limits, lambda _: None, self.no_internal_error, store)

    def no_internal_error(self, note: str) -> None:
        assert 'internal error' not in note, note

    def teardown(self) -> None:
        self.service.close()
        shutil.rmtree(self.directory)

    def send(self, client: str, reference: str, words: str, *args: str) -> DirectiveResponse:
        command, primary, secondary, *_ = (*words.split(), '', '', '')
        answer = self.service.execute(
            DirectiveRequest(client, reference, command, primary, secondary, args)
        )
        assert '\n' not in answer.error_description
        assert 'internal error' not in answer.error_description
        return answer

    def change(
        self,
        client: str,
        reference: str,
        words: str,
        args: Sequence[str],
        changes: Sequence[tuple[str, tuple[str, ...]]],
        valid: bool = True,
    ) -> None:
        answer = self.send(client, reference, words, *args)
        model = self.models.get(reference)
        if model is None:
            expected = 205
        elif model.mounted not in ('none', client):
            expected = 102
        elif not valid:
            expected = 205
        else:
            expected = 0
            model.submit(changes)
        assert (answer.success, answer.exit_code) == (expected == 0, expected)

    @initialize(buffered=st.booleans())
    def first_load(self, buffered: bool) -> None:
        self.load('one', 'r', buffered)

    @rule(client=CLIENTS, reference=REFERENCES, buffered=st.booleans())
    def load(self, client: str, reference: str, buffered: bool) -> None:
        args = ('four_classes.owl', BASE, str(buffered), '', 'false')
        path = str(FIXTURES / args[0])
        answer = self.send(client, reference, 'LOAD FILE', path, *args[1:])
        model = self.models.setdefault(reference, Model(buffered))
        if model.mounted not in ('none', client) and model.buffered != buffered:
            assert answer.exit_code == 102
            return
        assert answer.success
        model.buffered = buffered
        if not buffered:
            model.flush()

    @rule(client=CLIENTS, reference=REFERENCES)
    def drop(self, client: str, reference: str) -> None:
        answer = self.send(client, reference, 'DROP')
        model = self.models.get(reference)
        if model is not None and model.mounted not in ('none', client):
            assert answer.exit_code == 102
            return
        assert answer.success
        self.models.pop(reference, None)

    @rule(client=CLIENTS, reference=REFERENCES)
    def mount(self, client: str, reference: str) -> None:
        answer = self.send(client, reference, 'MOUNT')
        model = self.models.get(reference)
        free = model is not None and model.mounted in ('none', client)
        assert (answer.success, answer.exit_code) == (free, 0 if free else 203)
        if model is not None and free:
            model.mounted = client

    @rule(client=CLIENTS, reference=REFERENCES)
    def unmount(self, client: str, reference: str) -> None:
        answer = self.send(client, reference, 'UNMOUNT')
        model = self.models.get(reference)
        assert answer.success == (model is not None)
        if model is not None and model.mounted == client:
            model.mounted = 'none'

    @rule(client=CLIENTS, reference=REFERENCES, reason=st.booleans())
    def flush(self, client: str, reference: str, reason: bool) -> None:
        answer = self.send(client, reference, 'REASON' if reason else 'APPLY')
        model = self.models.get(reference)
        if model is not None and model.mounted in ('none', client):
            assert answer.success
            model.flush()
        else:
            assert not answer.success

    @rule(client=CLIENTS, reference=REFERENCES, ind=INDIVIDUALS, cls=CLASSES, add=st.booleans())
    def of_class(self, client: str, reference: str, ind: str, cls: str, add: bool) -> None:
        words, what = ('add ind CLASS', 'add') if add else ('REMOVE Ind class', 'remove')
        self.change(client, reference, words, (ind, cls), [(what, ('type', cls, bare(ind)))])

    @rule(client=CLIENTS, reference=REFERENCES, sub=CLASSES, sup=CLASSES, add=st.booleans())
    def subclass(self, client: str, reference: str, sub: str, sup: str, add: bool) -> None:
        words, what = ('ADD CLASS CLASS', 'add') if add else ('REMOVE CLASS CLASS', 'remove')
        self.change(client, reference, words, (sub, sup), [(what, ('sub', sub, sup))])

    @rule(
        client=CLIENTS,
        reference=REFERENCES,
        prop=PROPS,
        ind=INDIVIDUALS,
        other=INDIVIDUALS,
        what=st.sampled_from(['add', 'remove']),
    )
    def relation(
        self, client: str, reference: str, prop: str, ind: str, other: str, what: str
    ) -> None:
        fact = ('object', prop, bare(ind), bare(other))
        self.change(client, reference, f'{what} OBJECTPROP IND', (prop, ind, other), [(what, fact)])

    @rule(
        client=CLIENTS,
        reference=REFERENCES,
        prop=PROPS,
        ind=INDIVIDUALS,
        new=INDIVIDUALS,
        old=INDIVIDUALS,
    )
    def replace_relation(
        self, client: str, reference: str, prop: str, ind: str, new: str, old: str
    ) -> None:
        changes = [
            ('remove', ('object', prop, bare(ind), bare(old))),
            ('add', ('object', prop, bare(ind), bare(new))),
        ]
        self.change(client, reference, 'REPLACE OBJECTPROP IND', (prop, ind, new, old), changes)

    @rule(
        client=CLIENTS,
        reference=REFERENCES,
        prop=DATA,
        ind=INDIVIDUALS,
        value=VALUES,
        what=st.sampled_from(['add', 'remove']),
    )
    def value(
        self, client: str, reference: str, prop: str, ind: str, value: str, what: str
    ) -> None:
        fact = ('data', prop, bare(ind), value.split('"')[1] if '"' in value else value)
        self.change(
            client,
            reference,
            f'{what} DATAPROP IND',
            (prop, ind, 'LONG', value),
            [(what, fact)],
            valid=value != 'x',
        )

    @rule(client=CLIENTS, reference=REFERENCES, old=INDIVIDUALS, new=INDIVIDUALS)
    def rename(self, client: str, reference: str, old: str, new: str) -> None:
        changes = [('rename', (bare(old), bare(new)))]
        self.change(client, reference, 'RENAME IND', (old, new), changes)

    @rule(client=CLIENTS, reference=REFERENCES, ind=INDIVIDUALS)
    def remove_individual(self, client: str, reference: str, ind: str) -> None:
        self.change(client, reference, 'REMOVE IND', (ind,), [('forget', (bare(ind),))])

    @rule(client=CLIENTS, reference=REFERENCES, inds=st.lists(INDIVIDUALS, min_size=1, max_size=4))
    def batch(self, client: str, reference: str, inds: list[str]) -> None:
        rows = [DirectiveRequest(client, reference, 'ADD', 'IND', 'CLASS', (i, 'K')) for i in inds]
        answer = self.service.execute_list(rows)
        model = self.models.get(reference)
        done = model is not None and model.mounted in ('none', client)
        assert answer.success == done
        if model is not None and done:
            model.submit([('add', ('type', 'K', bare(ind))) for ind in inds])

    @rule()
    def restart(self) -> None:
        self.service.close()
        self.start()
        assert self.service.workspace.references.names() == sorted(self.models)

    @rule(reference=REFERENCES, ind=INDIVIDUALS, cls=CLASSES, prop=PROPS, data=DATA)
    def ask(self, reference: str, ind: str, cls: str, prop: str, data: str) -> None:
        model = self.models.get(reference)
        if model is None:
            assert self.send('one', reference, 'QUERY IND', ind).exit_code == 205
            return

        def objects(words: str, *args: str) -> set[str]:
            return {bare(x) for x in self.send('two', reference, words, *args).queried_objects}

        name = bare(ind)
        assert objects('QUERY IND CLASS', cls) == model.instances(cls)
        assert objects('QUERY IND', ind) == model.types(name)
        related = {f[3] for f in model.facts if f[:3] == ('object', prop, name)}
        assert objects('QUERY OBJECTPROP IND', prop, ind) == related
        values = {f[3] for f in model.facts if f[:3] == ('data', data, name)}
        rendered = {f'"{value}"^^xsd:long' for value in values}
        assert objects('QUERY DATAPROP IND', data, ind) == rendered
        facts = {f'{f[1]}({f[2]}, {f[3]})' for f in model.facts if f[:2] == ('object', prop)}
        assert objects('QUERY FACT', f'{prop}(?, ?)') == facts


def test_random_directives_do_what_the_model_does() -> None:
    run_state_machine_as_test(
        Directives,
        settings=settings(
            max_examples=20,
            stateful_step_count=30,
            suppress_health_check=list(HealthCheck),
        ),
    )


@pytest.mark.long
@pytest.mark.timeout(0)
def test_random_directives_for_longer() -> None:
    run_state_machine_as_test(
        Directives,
        settings=settings(
            max_examples=2000,
            stateful_step_count=60,
            derandomize=False,
            suppress_health_check=list(HealthCheck),
        ),
    )


WORDS = [*sorted({word for key in TABLE for word in key}), 'NO', 'sparql', '\x00']
TEXTS = st.one_of(
    st.text(max_size=30),
    st.sampled_from(['Class_1', 'LONG', 'true', '../../etc/passwd', '"1"^^xsd:long', 'x' * 5000]),
)


@settings(max_examples=150)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(WORDS),
            st.sampled_from(WORDS),
            st.sampled_from(WORDS),
            st.lists(TEXTS, max_size=6),
            st.sampled_from(['r', '', 'other']),
        ).filter(lambda d: 'SPARQL' not in d and 'SCREEN' not in d),
        min_size=1,
        max_size=5,
    )
)
def test_nothing_that_is_sent_makes_it_raise(directives: list[tuple[object, ...]]) -> None:
    notes: list[str] = []
    service = ArmorService(
        Settings(ontologies_folder='/nonexistent', read_only_directories=(FIXTURES,)),
        warn=notes.append,
    )
    load = (str(FIXTURES / 'four_classes.owl'), BASE, 'false', '', 'false')
    service.execute(DirectiveRequest('c', 'r', 'LOAD', 'FILE', '', load))
    for command, primary, secondary, args, reference in directives:
        request = DirectiveRequest('c', reference, command, primary, secondary, args)  # type: ignore[arg-type]
        answer = service.execute(request)
        assert '\n' not in answer.error_description
        assert answer.success or answer.error_description or not answer.exit_code
    assert not [note for note in notes if 'internal error' in note], notes
    service.close()
