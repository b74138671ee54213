"""What a World's file lacks of its reference, and what it remembers beside the axioms."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from armor_service.changes import AddAxiom, Change, RemoveAxiom, apply_all
from armor_service.quarantine import Submission
from armor_service.reference import Origin, Reference
from armor_service.store.records import TO_JSON, decode, encode, submission_as_json, submission_of
from armor_service.store.world_connection import count_step
from armor_service.store.world_ontology import WorldOntology
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of


class Unwritten:
    """What the file lacks, which becomes nothing at once when it is written.

    Attributes:
        whole: Whether it lacks all.
        net: Asserted axioms that came (1) and went (-1).
        derived: Derived ones, likewise, where `derived_known`.
        derived_known: Whether it is known which derived facts the file has.
        told: The directives that did that.
        groups: Those that nobody reasoned over yet, each with what it changed.
    """

    def __init__(self) -> None:
        self.whole = False
        self.net: dict[Axiom, int] = {}
        self.derived: dict[Axiom, int] = {}
        self.derived_known = True
        self.told: list[Submission] = []
        self.groups: list[tuple[list[Submission], dict[Axiom, int]]] = []
        self._delta: dict[Axiom, int] = {}
        self._quiet = False

    def follow(self, ref: Reference) -> None:
        """Take note of what changes in a reference from now on."""
        ref.kb.subscribe(self._note)
        ref.on_applied = self.applied
        ref.on_rolled_back = self._rolled_back

    def _note(self, changes: Changes) -> None:
        for step, batch in ((-1, changes.removed), (1, changes.added)):
            for axiom, derived in batch:
                if derived:
                    if self.derived_known:
                        count_step(self.derived, axiom, step)
                elif not self._quiet:
                    count_step(self.net, axiom, step)
                    count_step(self._delta, axiom, step)

    def applied(self, told: list[Submission]) -> None:
        """Take note of directives whose changes were made since the last call."""
        self.told += told
        self.groups.append((told, self.take_delta()))

    def _rolled_back(self, lines: list[str], undo: list[Change]) -> None:
        self.told.append(Submission('', 0.0, tuple(undo)))
        self._delta = {}

    def take_delta(self) -> dict[Axiom, int]:
        """Return what changed since the last call, and begin anew."""
        delta, self._delta = self._delta, {}
        return delta

    @contextmanager
    def already_written(self) -> Iterator[None]:
        """Take no note of asserted axioms inside: the file has them."""
        self._quiet = True
        try:
            yield
        finally:
            self._quiet = False

    def merge(
        self,
        kb: KnowledgeBase,
        changes: Sequence[AddAxiom | RemoveAxiom],
        replacing: Sequence[Change],
    ) -> dict[Axiom, int]:
        """Make changes that the file has already, before those that wait to be written.

        Args:
            kb: The ontology.
            changes: What others wrote.
            replacing: What is to be written in place of a part of it.

        Returns:
            What the two changed.
        """
        delta: dict[Axiom, int] = {}
        with self.already_written():
            for change in changes:
                count_step(delta, change.axiom, 1 if isinstance(change, AddAxiom) else -1)
            apply_all(kb, changes)
        self._delta = delta
        apply_all(kb, replacing)
        delta = self.take_delta()
        for one in self.told:
            apply_all(kb, one.changes)
        self.net = {a: step for a, step in self.net.items() if (a in kb) == (step > 0)}
        self._delta = {}
        return delta

    def __bool__(self) -> bool:
        return bool(self.net or self.derived or self.told or self.whole)

    def write(self, ref: Reference, ontology: WorldOntology, inferred: WorldOntology) -> None:
        """Write what is lacking, in a transaction; `written` follows when that is committed."""
        if self.whole:
            ontology.write_header()
            ontology.add_all(ref.kb.axioms())
            inferred.become(ref.kb.derived_facts() if ref.opened else ())
            return
        gone = [axiom for axiom, step in self.net.items() if step < 0]
        for axiom in gone:
            ontology.remove(axiom)
        for axiom, step in self.net.items():
            if step > 0:
                ontology.add(axiom)
        for entity in dict.fromkeys(entity for axiom in gone for entity in entities_of(axiom)):
            if not ref.kb.is_known(*entity):
                ontology.forget(*entity)
        if not self.derived_known and ref.opened:
            inferred.become(ref.kb.derived_facts())
            return
        for axiom, step in self.derived.items():
            (inferred.remove if step < 0 else inferred.add)(axiom)

    def written(self, ref: Reference) -> None:
        """Lack nothing."""
        self.derived_known = ref.opened if self.whole else self.derived_known or ref.opened
        self.net.clear()
        self.derived.clear()
        self.told, self.groups = [], []
        self.whole = False


class Remembered:
    """What the service's tables of the file say of a reference beside its axioms."""

    def __init__(self) -> None:
        self._state: dict[str, str] = {}
        self._waiting: list[Submission] = []
        self._has_untested = False
        self._next: dict[str, str] = {}
        self._origin: tuple[Origin | None, str] = (None, '')

    def state(self, ref: Reference, record: int | str) -> dict[str, str]:
        """Return what is remembered of a reference, by keys.

        Args:
            ref: The reference.
            record: The number of the last record of the spill that the file holds.
        """
        buffering = ref.buffering
        dump = TO_JSON.encode
        return {
            'name': ref.name,
            'iri': ref.kb.iri,
            'origin': self._origin_text(ref.origin),
            'buffering': dump([buffering.manipulation, buffering.reasoner]),
            'mounted': ref.mounted,
            'base': repr(ref.effort.base),
            'quarantine': dump(ref.quarantine.lines),
            'record': str(record),
        }

    def _origin_text(self, origin: Origin) -> str:
        if self._origin[0] is not origin:
            parts = [origin.path, origin.format, dict(origin.prefixes)]
            self._origin = origin, TO_JSON.encode(parts)
        return self._origin[1]

    def differs(self, ref: Reference, record: int) -> bool:
        """Tell whether the file is to say something else."""
        return (
            (self._has_untested and not ref.quarantine.untested)
            or not _same(self._waiting, ref.buffering.waiting)
            or self.state(ref, record) != self._state
        )

    def forget(self) -> None:
        """Take note that the tables are empty."""
        self._state, self._waiting, self._has_untested = {}, [], False

    def read(self, db: sqlite3.Connection, ref: Reference, state: dict[str, str]) -> None:
        """Give a reference, whose axioms were read, its directives back.

        Args:
            db: The file.
            ref: The reference, which gets those that wait and those that nobody reasoned over.
            state: What was found in the file.
        """
        rows = db.execute('SELECT waits, told, come, gone FROM armor_told ORDER BY id')
        groups = [(waits, *map(json.loads, texts)) for waits, *texts in rows]
        self._has_untested = not all(waits for waits, *_ in groups)
        origin = dict.fromkeys(ref.kb.axioms() if self._has_untested else ())
        for waits, _, come, gone in reversed(groups):
            if not waits:
                for axiom in come:
                    origin.pop(decode(axiom), None)
                origin.update(dict.fromkeys(map(decode, gone)))
        for waits, told, _, _ in groups:
            (ref.buffering.waiting if waits else ref.quarantine.untested).extend(
                submission_of(*one) for one in told
            )
        if self._has_untested:
            ref.quarantine.origin = tuple(origin)
        self._waiting = list(ref.buffering.waiting)
        self._state = state

    def write(
        self, db: sqlite3.Connection, ref: Reference, lacking: Unwritten, record: int
    ) -> None:
        """Write what is to be remembered; `written` follows when that is committed."""
        waiting, untested = ref.buffering.waiting, ref.quarantine.untested
        start = len(self._waiting)
        if not _same(self._waiting, waiting[:start]):
            db.execute('DELETE FROM armor_told WHERE waits')
            start = 0
        rows: list[tuple[object, ...]] = [
            (1, TO_JSON.encode([submission_as_json(one)]), '[]', '[]') for one in waiting[start:]
        ]
        if not untested and self._has_untested:
            db.execute('DELETE FROM armor_told WHERE NOT waits')
        for told, delta in lacking.groups if untested else ():
            parts = [[encode(a) for a, step in delta.items() if step == sign] for sign in (1, -1)]
            texts = map(TO_JSON.encode, ([submission_as_json(one) for one in told], *parts))
            rows.append((0, *texts))
        db.executemany('INSERT INTO armor_told VALUES (NULL, ?, ?, ?, ?)', rows)
        self._next = self.state(ref, record)
        changed = [pair for pair in self._next.items() if self._state.get(pair[0]) != pair[1]]
        db.executemany('INSERT OR REPLACE INTO armor_state VALUES (?, ?)', changed)

    def written(self, ref: Reference) -> None:
        """Know that the file says so now."""
        self._state = self._next
        self._waiting = list(ref.buffering.waiting)
        self._has_untested = bool(ref.quarantine.untested)


def _same(first: list[Submission], second: list[Submission]) -> bool:
    """Tell whether two lists hold the same directives, by the last ones."""
    return len(first) == len(second) and (not first or first[-1] is second[-1])
