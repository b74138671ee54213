"""`sync_reasoner_native`: what follows, in the Python objects of owlready2, without Java.

It has the effects of owlready2's `sync_reasoner_pellet`: classes and individuals get the most
specific classes that follow as parents, individuals the values that follow, impossible classes
become equivalent to ``Nothing``, properties that relate nothing to the empty property, and a
contradiction is an `OwlReadyInconsistentOntologyError`.

A World keeps its reasoner between calls. Triggers of SQLite write down which quads changed since,
so that a call costs what changed, not what is there. What follows no more is taken back, in the
quad store and in the objects; Pellet leaves it.
"""

from __future__ import annotations

import math
import threading
import warnings
import weakref
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import owlready2
from owlready2 import reasoning as owlready2_reasoning
from owlready2.base import LOADING
from owlready2.namespace import CURRENT_NAMESPACES

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import DataSomeValuesFrom, ObjectSomeValuesFrom
from owl_reasoner.owl.vocabulary import NOTHING, OWL, RDF, RDFS, THING, TOP_LITERAL
from owl_reasoner.owlready.quads import Quad, StoredNames, contexts_of, read_axioms, stored_value

INFERRED = 'http://inferrences/'
"""The ontology for what follows where none is named; owlready2 spells it so."""
RESERVED = 300
"""The largest number that owlready2 keeps for the words of OWL."""
_LOG = 'owl_reasoner_log'
_TYPE, _SUBCLASS, _EQUIVALENT = RDF + 'type', RDFS + 'subClassOf', OWL + 'equivalentClass'
_SAME_PROPERTY = OWL + 'equivalentProperty'
_EMPTY = {
    'object_property': OWL + 'bottomObjectProperty',
    'data_property': OWL + 'bottomDataProperty',
}
"""The empty property of each kind."""
_SCHEMA = (_SUBCLASS, _EQUIVALENT, _SAME_PROPERTY)
_PROBE = 'urn:owl_reasoner:has:'
"""Before the name of a property: the class of what has a value of it, impossible if nothing can."""
_PYTHON_NAME = 'http://www.lesfleursdunormal.fr/static/_downloads/owlready_ontology.owl#python_name'
_UNREASONED = {_PYTHON_NAME, *(RDFS + name for name in ('label', 'comment', 'seeAlso'))}
_ANY_KIND = ('class', 'object_property', 'data_property', 'annotation_property', 'datatype')


class IncompleteReasoningWarning(UserWarning):
    """Something in the ontologies was not used; the text says what."""


def sync_reasoner_native(
    x: Any = None,
    infer_property_values: bool = True,
    infer_data_property_values: bool = True,
    timeout: float = math.inf,
    cancel: threading.Event | None = None,
    debug: int = 0,
) -> None:
    """Reason over a World, and have what follows in its Python objects.

    Args:
        x: A World, an ontology (all of its World, and what follows goes into the ontology), or a
            list of ontologies (these alone); None: owlready2's default World.
        infer_property_values: Also relations of individuals.
        infer_data_property_values: Also values of individuals.
        timeout: Seconds after which it ends.
        cancel: Ends it once it is set.
        debug: As for owlready2's reasoners: above 0, what changed is printed.

    Raises:
        OwlReadyInconsistentOntologyError: The ontologies contradict themselves; it says why.
        ReasoningBudgetError: It was ended. Nothing has changed.
    """
    if isinstance(x, owlready2.World):
        world, chosen = x, None
    elif isinstance(x, owlready2.Ontology):
        world, chosen = x.world, None
    elif isinstance(x, (list, tuple)):
        world, chosen = x[0].world, tuple(ontology.graph.c for ontology in x)
    else:
        world, chosen = owlready2.default_world, None
    if isinstance(x, owlready2.Ontology):
        target = x
    elif CURRENT_NAMESPACES.get():
        target = CURRENT_NAMESPACES.get()[-1].ontology
    else:
        target = world.get_ontology(INFERRED)
    sessions = _SESSIONS.setdefault(world, {})
    key = (chosen, target.graph.c, infer_property_values, infer_data_property_values)
    session = sessions.get(key)
    if session is None or session.graph is not world.graph:
        session = sessions[key] = _Session(world, target, chosen, key[2], key[3])
    session.update(timeout, cancel, debug)


_SESSIONS: weakref.WeakKeyDictionary[Any, dict[Any, _Session]] = weakref.WeakKeyDictionary()


@dataclass(slots=True)
class _Kinds:
    """What names stand for, where they stand for one thing alone."""

    single: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, declared: Iterable[tuple[str, str]]) -> _Kinds:
        kinds: dict[str, set[str]] = {}
        for kind, name in declared:
            kinds.setdefault(name, set()).add(kind)
        return cls({name: next(iter(found)) for name, found in kinds.items() if len(found) == 1})


class _Session:
    """The reasoner of some ontologies of one World, and what it wrote there.

    Args:
        world: The World.
        target: Where what follows is written.
        chosen: The numbers of the ontologies that are read; None: all but `INFERRED`.
        relations: Write relations of individuals.
        values: Write values of individuals.

    Attributes:
        graph: The quad store.
    """

    def __init__(
        self,
        world: Any,
        target: Any,
        chosen: tuple[int, ...] | None,
        relations: bool,
        values: bool,
    ) -> None:
        self.graph = world.graph
        # A session must not keep its World alive.
        self._world = weakref.ref(world)
        self._target_iri = target.base_iri
        self._chosen = chosen
        self._relations, self._values = relations, values
        self._kb: KnowledgeBase | None = None
        self._kinds = _Kinds()
        self._names: dict[int, str] = {}
        self._classified = -1
        self._seen = 0
        self._written: dict[Quad, None] = {}
        self._touched: set[str] = set()
        _watch(world.graph)
        if self._target_iri == INFERRED:
            # Of another program, or of before: it is replaced.
            rows = world.graph.execute('SELECT s, p, o FROM objs WHERE c=?', (target.graph.c,))
            header = (target.storid, world._abbreviate(_TYPE), world._abbreviate(OWL + 'Ontology'))
            self._written.update((tuple(row), None) for row in rows if tuple(row) != header)
            rows = world.graph.execute('SELECT s, p, o, d FROM datas WHERE c=?', (target.graph.c,))
            self._written.update((tuple(row), None) for row in rows)

    @property
    def world(self) -> Any:
        return self._world()

    @property
    def target(self) -> Any:
        return self.world.get_ontology(self._target_iri)

    def update(self, timeout: float, cancel: threading.Event | None, debug: int) -> None:
        """Read what changed, reason, and write what follows."""
        unread = self._read()
        kb = self._kb
        assert kb is not None
        if not kb.reason(timeout, cancel):
            explanation = kb.explain_inconsistency()
            why = explanation.sentence() if explanation else 'they contradict themselves'
            raise owlready2.OwlReadyInconsistentOntologyError(why)
        self._write(debug)
        left_out = [*unread, *kb.unsupported]
        if left_out:
            more = f' and {len(left_out) - 3} more' if len(left_out) > 3 else ''
            text = f'not used by the reasoner: {"; ".join(left_out[:3])}{more}'
            warnings.warn(text, IncompleteReasoningWarning, stacklevel=4)

    # --- reading ---

    def _contexts(self) -> tuple[int, ...]:
        if self._chosen is not None:
            return self._chosen
        inferred = self.world.ontologies.get(INFERRED)
        left_out = inferred.graph.c if inferred else None
        return tuple(number for number in contexts_of(self.world) if number != left_out)

    def _read(self) -> list[str]:
        """Take in what changed since the last call; return what was not understood."""
        execute = self.graph.execute
        last = execute(f'SELECT coalesce(max(rowid), 0) FROM {_LOG}').fetchone()[0]
        since, self._seen = self._seen, last
        if self._kb is not None:
            rows = execute(f'SELECT DISTINCT c, s, p, o, d FROM {_LOG} WHERE rowid>?', (since,))
            changes = self._simple(rows.fetchall())
            if changes is not None:
                self._kb.change(*changes)
                return []
        hidden = () if self._target_iri == INFERRED else self._written
        self._names = {}
        mapping = read_axioms(self.world, self._contexts(), hidden, self._names)
        self._kinds = _Kinds.of(mapping.declared)
        # What an ontology of the World imports is read as well; so far as it was chosen, at least.
        there = {iri.rstrip('#/') for iri in self.world.ontologies}
        told = (
            axiom
            for axiom in mapping.axioms
            if not isinstance(axiom, ax.Import) or axiom.iri.rstrip('#/') not in there
        )
        found = dict.fromkeys((*told, *self._probes()))
        if self._kb is None:
            self._kb = KnowledgeBase('', found)
            self._kb.subscribe(self._note)
            self._touched.update(self._all_named())
        else:
            known = dict.fromkeys(self._kb.axioms())
            come = [axiom for axiom in found if axiom not in known]
            self._kb.change(come, [axiom for axiom in known if axiom not in found])
        return mapping.unsupported

    def _probes(self) -> Iterator[Axiom]:
        """Yield for each property a class whose members would have a value of it."""
        for name, kind in self._kinds.single.items():
            if name.startswith(OWL):
                continue
            if kind == 'object_property':
                yield ax.SubClassOf(_PROBE + name, ObjectSomeValuesFrom(name, THING))
            elif kind == 'data_property':
                yield ax.SubClassOf(_PROBE + name, DataSomeValuesFrom(name, TOP_LITERAL))

    def _simple(self, rows: list[tuple[Any, ...]]) -> tuple[list[Axiom], list[Axiom]] | None:
        """Return what came and what went, where all of it is of individuals; else None."""
        come: list[Axiom] = []
        gone: list[Axiom] = []
        names, contexts = StoredNames(self.world, self._names), set(self._contexts())
        own = self.target.graph.c
        for c, *quad in rows:
            if c is None:
                return None
            found: Quad = tuple(quad if quad[3] is not None else quad[:3])
            if c not in contexts or (c == own and found in self._written):
                continue
            axiom = self._fact(names, found)
            if axiom is None:
                return None
            if axiom is not _NOTHING_SAID:
                (come if self._is_there(found, contexts) else gone).append(axiom)
        return come, gone

    def _fact(self, names: StoredNames, quad: Quad) -> Axiom | None:
        """Return the fact that a quad states; None where it takes part in another axiom."""
        subject, predicate, value = names.triple(quad)
        kinds = self._kinds.single
        if predicate in _UNREASONED or kinds.get(predicate) == 'annotation_property':
            return _NOTHING_SAID
        if subject[:2] == '_:' or kinds.get(subject) in _ANY_KIND:
            return None
        if not isinstance(value, str):
            if kinds.get(predicate) == 'data_property':
                return ax.DataPropertyAssertion(predicate, subject, value)
            return None
        if value[:2] == '_:':
            return None
        if predicate == _TYPE:
            if value == OWL + 'NamedIndividual':
                return ax.Declaration('individual', subject)
            is_class = kinds.get(value) == 'class' or value == THING
            return ax.ClassAssertion(value, subject) if is_class else None
        if kinds.get(predicate) == 'object_property':
            return ax.ObjectPropertyAssertion(predicate, subject, value)
        return None

    def _is_there(self, quad: Quad, contexts: Iterable[int]) -> bool:
        table = 'objs' if len(quad) == 3 else 'datas'
        same = 's=? AND p=? AND o=?' + (' AND d=?' if len(quad) == 4 else '')
        chosen = ','.join(map(str, contexts))
        query = f'SELECT 1 FROM {table} WHERE {same} AND c IN ({chosen}) LIMIT 1'
        return self.graph.execute(query, quad).fetchone() is not None

    # --- writing ---

    def _note(self, changes: Changes) -> None:
        for axiom, derived in (*changes.added, *changes.removed):
            if isinstance(axiom, ax.ClassAssertion):
                self._touched.add(axiom.individual)
            if isinstance(axiom, ax.ObjectPropertyAssertion | ax.DataPropertyAssertion):
                self._touched.add(axiom.subject)
            elif not derived and isinstance(axiom, ax.Declaration):
                self._touched.add(axiom.iri)

    def _all_named(self) -> Iterator[str]:
        assert self._kb is not None
        for axiom in self._kb.axioms():
            if isinstance(axiom, ax.ClassAssertion):
                yield axiom.individual
            elif isinstance(axiom, ax.ObjectPropertyAssertion):
                yield from (axiom.subject, axiom.object)
            elif isinstance(axiom, ax.DataPropertyAssertion):
                yield axiom.subject
            elif isinstance(axiom, ax.Declaration) and axiom.kind == 'individual':
                yield axiom.iri

    def _write(self, debug: int) -> None:
        kb, number = self._kb, self.world._abbreviate
        assert kb is not None
        entities = [(name, False) for name in self._touched if name[:2] != '_:']
        self._touched = set()
        if kb.classified != self._classified:
            self._classified = kb.classified
            entities += [
                (name, True)
                for name, kind in self._kinds.single.items()
                if (kind == 'class' or kind in _EMPTY)
                and name[:2] != '_:'
                and name not in (THING, NOTHING)
            ]
        come: list[Quad] = []
        gone: list[Quad] = []
        parents: dict[int, list[int]] = {}
        types: dict[int, str] = {}
        for name, is_schema in entities:
            storid = number(name)
            empty = _EMPTY.get(self._kinds.single[name]) if is_schema else None
            above: set[str] = set()
            if empty is not None:
                found = self._of_property(name, empty)
            elif is_schema:
                above = self._superclasses(name)
                found = self._of_class(name, above)
            else:
                above = _most_specific(kb, kb.types(name))
                found = self._of_individual(name, above)
            if above:
                parents[storid] = [number(cls) for cls in sorted(above)]
                types[storid] = 'class' if is_schema else 'individual'
            before, after = self._own(storid, is_schema), dict.fromkeys(found)
            gone += [quad for quad in before if quad not in after]
            come += [quad for quad in after if quad not in before]
        self._apply(come, gone, parents, types, debug)

    def _own(self, storid: int, is_schema: bool) -> list[Quad]:
        """Return what was written of an entity: as a class or property, or as an individual."""
        execute, c = self.graph.execute, self.target.graph.c
        found: list[Quad] = execute(
            'SELECT s, p, o FROM objs WHERE s=? AND c=?', (storid, c)
        ).fetchall()
        found += execute('SELECT s, p, o, d FROM datas WHERE s=? AND c=?', (storid, c)).fetchall()
        schema = {self.world._abbreviate(name) for name in _SCHEMA}
        written = (quad for quad in found if quad in self._written)
        return [quad for quad in written if (quad[1] in schema) == is_schema]

    def _of_individual(self, name: str, types: Iterable[str]) -> Iterator[Quad]:
        """Yield what follows of an individual and is not asserted."""
        kb, number = self._kb, self.world._abbreviate
        assert kb is not None
        subject, kind = number(name), number(_TYPE)
        for cls in types:
            yield from self._new((subject, kind, number(cls)))
        if self._relations:
            for prop in kb.object_properties_of(name):
                if prop.startswith(OWL):
                    continue
                inverse = self._inverse(prop)
                for other in kb.object_values(prop, name):
                    quad = (subject, number(prop), number(other))
                    if other[:2] != '_:' and not (
                        inverse and self._is_asserted((quad[2], inverse, subject))
                    ):
                        yield from self._new(quad)
        if self._values:
            for prop in kb.data_properties_of(name):
                if prop.startswith(OWL):
                    continue
                for value in kb.data_values(prop, name):
                    datatype: int | str = f'@{value.language}'
                    if not value.language:
                        datatype = number(value.datatype)
                    yield from self._new((subject, number(prop), stored_value(value), datatype))

    def _superclasses(self, name: str) -> set[str]:
        """Return the most specific classes above a class, without those that are equal to it."""
        kb = self._kb
        assert kb is not None
        supers = {sup for sup in kb.superclasses(name) if name not in kb.superclasses(sup)}
        impossible = kb.holds(ax.SubClassOf(name, NOTHING))
        return set() if impossible else _most_specific(kb, supers - {THING})

    def _of_class(self, name: str, supers: Iterable[str]) -> Iterator[Quad]:
        """Yield what follows of a class and is not asserted."""
        kb, number = self._kb, self.world._abbreviate
        assert kb is not None
        cls, above, same = number(name), number(_SUBCLASS), number(_EQUIVALENT)
        if kb.holds(ax.SubClassOf(name, NOTHING)):
            yield from self._new((cls, same, number(NOTHING)))
            return
        if kb.holds(ax.SubClassOf(THING, name)):
            yield from self._new((cls, same, number(THING)))
        for other in kb.superclasses(name):
            if name in kb.superclasses(other):
                yield from self._new((cls, same, number(other)))
        for sup in supers:
            yield from self._new((cls, above, number(sup)))

    def _of_property(self, name: str, empty: str) -> Iterator[Quad]:
        """Yield that a property relates nothing, where that follows and is not asserted."""
        kb, number = self._kb, self.world._abbreviate
        assert kb is not None
        if kb.holds(ax.SubClassOf(_PROBE + name, NOTHING)):
            yield from self._new((number(name), number(_SAME_PROPERTY), number(empty)))

    def _new(self, quad: Quad) -> Iterator[Quad]:
        if not self._is_asserted(quad):
            yield quad

    def _is_asserted(self, quad: Quad) -> bool:
        """Tell whether a quad is there, and not by this."""
        table = 'objs' if len(quad) == 3 else 'datas'
        found = self.graph.execute(f'SELECT c FROM {table} WHERE s=? AND p=? AND o=?', quad[:3])
        own = self.target.graph.c
        return any(c != own or quad not in self._written for (c,) in found)

    def _inverse(self, prop: str) -> int:
        found = self.world[prop]
        inverse = getattr(found, '_inverse_property', None)
        return inverse.storid if inverse else 0

    def _apply(
        self,
        come: list[Quad],
        gone: list[Quad],
        parents: dict[int, list[int]],
        types: dict[int, str],
        debug: int,
    ) -> None:
        """Write quads, and bring the Python objects that are loaded up to date."""
        world, target, number = self.world, self.target, self.world._abbreviate
        kind, above = number(_TYPE), number(_SUBCLASS)
        same = {number(_EQUIVALENT): 'class', number(_SAME_PROPERTY): 'property'}
        schema = {kind, above, *same}
        for quad in gone:
            self._written.pop(quad, None)
            if len(quad) == 3:
                target._del_obj_triple_spo(*quad)
            else:
                target._del_data_triple_spod(*quad)
        _take_back(world, [quad for quad in gone if quad[1] in schema], same)
        self._written.update(dict.fromkeys(come))
        equals: dict[int, list[int]] = {}
        relations: list[tuple[Any, ...]] = []
        values: list[tuple[Any, ...]] = []
        properties: dict[int, Any] = {}
        for quad in come:
            subject, predicate, value = quad[:3]
            if predicate in schema:
                if predicate in same:
                    types[subject] = same[predicate]
                    equals.setdefault(subject, []).append(value)
                continue
            if predicate not in properties:
                properties[predicate] = world._get_by_storid(predicate)
            prop = properties[predicate]
            if len(quad) == 3:
                relations.append((subject, prop, value))
            else:
                values.append((subject, prop, value, quad[3]))
        for quad in gone:
            if quad[1] not in schema:
                _forget_values(world, quad)
        apply = owlready2_reasoning
        apply._apply_reasoning_results(world, target, debug, parents, equals, types)
        apply._apply_inferred_obj_relations(world, target, debug, relations)
        apply._apply_inferred_data_relations(world, target, debug, values)


_NOTHING_SAID = ax.Declaration('individual', '')


def _watch(graph: Any) -> None:
    """Write down which quads change from now on; for this connection alone."""
    execute = graph.execute
    execute(f'CREATE TEMP TABLE IF NOT EXISTS {_LOG} (c, s, p, o, d)')
    for table, datatype in (('objs', 'NULL'), ('datas', '{}.d')):
        for event, rows in (('INSERT', ('NEW',)), ('DELETE', ('OLD',)), ('UPDATE', ('OLD', 'NEW'))):
            notes = ' '.join(
                f'INSERT INTO {_LOG} VALUES '
                f'({row}.c, {row}.s, {row}.p, {row}.o, {datatype.format(row)});'
                for row in rows
            )
            execute(
                f'CREATE TEMP TRIGGER IF NOT EXISTS {_LOG}_{table}_{event} AFTER {event} '
                f'ON main.{table} BEGIN {notes} END'
            )
    execute(
        f'CREATE TEMP TRIGGER IF NOT EXISTS {_LOG}_names AFTER UPDATE ON main.resources '
        f'BEGIN INSERT INTO {_LOG} VALUES (NULL, NULL, NULL, NULL, NULL); END'
    )


def _most_specific(kb: KnowledgeBase, classes: set[str]) -> set[str]:
    """Return the classes that have no other of them strictly below."""
    above: dict[str, set[str]] = {cls: kb.superclasses(cls) for cls in classes}
    return {
        cls
        for cls in classes
        if not any(cls in above[other] and other not in above[cls] for other in classes)
    }


def _take_back(world: Any, quads: list[Quad], same: Container[int]) -> None:
    """Give loaded entities the parents that the quad store has without what went."""
    for storid in {quad[0] for quad in quads}:
        entity = world._entities.get(storid)
        if entity is None:
            continue
        with LOADING:
            for subject, predicate, value in quads:
                if subject == storid and predicate in same:
                    other = world._get_by_storid(value)
                    if other in entity.equivalent_to:
                        entity.equivalent_to._remove(other)
            if isinstance(entity, owlready2.PropertyClass):
                continue
            is_class = isinstance(entity, owlready2.EntityClass)
            relation = world._abbreviate(_SUBCLASS if is_class else _TYPE)
            kept = [one for one in entity.is_a if isinstance(one, owlready2.Construct)]
            stored = {
                world._get_by_storid(parent)
                for parent in world._get_obj_triples_sp_o(storid, relation)
                if parent > RESERVED
            }
            named = {one for one in stored if isinstance(one, owlready2.ThingClass)}
            most = owlready2_reasoning._keep_most_specific(named, consider_equivalence=False)
            entity.is_a.reinit([*sorted(most, key=str), *kept] or [owlready2.Thing, *kept])


def _forget_values(world: Any, quad: Quad) -> None:
    """Have loaded objects read a relation or value again."""
    prop = world._get_by_storid(quad[1])
    holders = [(world._entities.get(quad[0]), prop)]
    if len(quad) == 3 and getattr(prop, '_inverse_property', None):
        holders.append((world._entities.get(quad[2]), prop._inverse_property))
    for entity, held in holders:
        if entity is not None and held is not None:
            entity.__dict__.pop(held._python_name, None)
