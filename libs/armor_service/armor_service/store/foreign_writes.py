"""What other programs write into a World's file, as changes of its reference."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from armor_service.changes import AddAxiom, RemoveAxiom, SetAssertion
from armor_service.quarantine import Submission
from armor_service.reference import Reference
from armor_service.store.assigned_numbers import assigned_numbers
from armor_service.store.unwritten import Unwritten
from armor_service.store.world_connection import (
    ANONYMOUS,
    ForeignRows,
    WorldConnection,
    free_name,
)
from armor_service.store.world_ontology import AxiomsRead, WorldOntology
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import renamed

FILE = 'file'
"""The client of what other programs wrote into a file."""
_KINDS = (
    *('class', 'object_property', 'data_property', 'annotation_property', 'individual'),
    *('datatype', 'annotated'),
)


class ForeignWrites:
    """Takes in what other programs wrote: each of it is a change of the reference, or undone.

    Args:
        file: The file.
        lacking: What the file lacks, which is done once more on top.
        tell: Told in one line of what is no OWL, and of what is left alone.
    """

    def __init__(
        self, file: WorldConnection, lacking: Unwritten, tell: Callable[[str], None]
    ) -> None:
        self._file, self._lacking, self._tell = file, lacking, tell
        self._others: set[int] = set()

    def take(
        self, ref: Reference, ontology: WorldOntology, inferred: WorldOntology
    ) -> Submission | None:
        """Take in what others changed, in a transaction, and what waits to be written after it.

        Args:
            ref: The reference.
            ontology, inferred: What is asserted and what is derived.

        Returns:
            The changes, over which nobody reasoned yet; None: there are none.
        """
        rows = self._file.take_foreign(ontology.context, inferred.context)
        if rows is None:
            return None
        if rows.derived:
            self._lacking.derived_known = False
        self._tell_others(ref, rows.others)
        kb = ref.kb
        changes = self._renamed(ref, ontology, rows.renamed)
        found = self._read(ontology, rows)
        for number in rows.forgotten:
            self._file.names.forget(number)
        replacing: list[SetAssertion] = []
        for axiom, typed in list(assigned_numbers(kb, found.added, found.removed)):
            replacing.append(SetAssertion(typed))
            found.added.remove(axiom)
            self._lacking.net[axiom] = -1
        come = {change.axiom for change in changes if isinstance(change, AddAxiom)}
        gone = {change.axiom for change in changes} - come

        def holds(axiom: Axiom) -> bool:
            """Tell whether it is there once things have their new names."""
            return axiom in come or (axiom in kb and axiom not in gone)

        changes += [RemoveAxiom(axiom) for axiom in found.removed if holds(axiom)]
        changes += [AddAxiom(axiom) for axiom in found.added if not holds(axiom)]
        if not changes and not replacing:
            return None
        delta = self._lacking.merge(kb, changes, replacing)
        for change in changes:
            if isinstance(change, AddAxiom):
                ontology.declare(change.axiom)
        told = Submission(FILE, time.time(), (*changes, *replacing))
        ref.quarantine.untested.append(told)
        self._lacking.groups.insert(0, ([told], delta))
        ref.revision += 1
        return told

    def _tell_others(self, ref: Reference, contexts: set[int]) -> None:
        """Say once of each other ontology of the file that it is not the reference's."""
        for context in sorted(contexts - self._others):
            self._others.add(context)
            query = 'SELECT iri FROM ontologies WHERE c=?'
            row = self._file.open().execute(query, (context,)).fetchone()
            if row is not None and row[0] != ANONYMOUS:
                self._tell(
                    f'what another program wrote in the ontology <{row[0]}> is kept '
                    f'and left alone: the reference is <{ref.kb.iri}>'
                )

    def _renamed(
        self, ref: Reference, ontology: WorldOntology, names: Sequence[tuple[int, str]]
    ) -> list[AddAxiom | RemoveAxiom]:
        changes: list[AddAxiom | RemoveAxiom] = []
        for number, old in names:
            new = self._file.names.name(number)
            after: dict[Axiom, Axiom] = {}
            for axiom in ref.kb.axioms_about(old):
                changed = axiom
                for kind in _KINDS:
                    changed = renamed(changed, kind, old, new)
                after[axiom] = changed
            ontology.renamed(after, old, new)
            changes += [RemoveAxiom(axiom) for axiom in after]
            changes += [AddAxiom(axiom) for axiom in after.values()]
        return changes

    def _read(self, ontology: WorldOntology, rows: ForeignRows) -> AxiomsRead:
        """Read the quads; what is no OWL is undone as a whole."""
        db = self._file.open()
        db.execute('SAVEPOINT foreign_changes')
        found = ontology.read_changes(rows.come, rows.gone)
        if found.problems:
            db.execute('ROLLBACK TO foreign_changes')
            self._refuse(ontology, rows, found.problems)
            found = AxiomsRead()
        db.execute('RELEASE foreign_changes')
        return found

    def _refuse(self, ontology: WorldOntology, rows: ForeignRows, problems: Sequence[str]) -> None:
        """Undo what is no OWL, and keep it in a file."""
        aside = free_name(self._file.path.with_suffix('.txt'), 'refused-')
        lines = [
            f'{sign} {" ".join(ontology.text(quad))} .\n'
            for sign, quads in (('+', rows.come), ('-', rows.gone))
            for quad in quads
        ]
        with suppress(OSError), aside.open('a') as file:
            file.writelines(lines)
        ontology.rolled_back()
        ontology.apply(rows.gone, rows.come)
        more = f' and {len(problems) - 1} more' if len(problems) > 1 else ''
        self._tell(
            f'what another program wrote is no OWL and undone: {problems[0]}{more}; '
            f'it is kept in {aside.name}'
        )
