"""An ontology in the file of an owlready2 World: axioms as quads, and which quads are whose.

owlready2 (Lamy, "Owlready", Artificial Intelligence in Medicine 2017) keeps triples in SQLite: the
table ``objs`` with numbers for names (negative ones for nodes without a name), and ``datas`` with
values. Most axioms of a robot are plain: one quad of named individuals, which needs no bookkeeping.
Of any other axiom the quads are known from what it was read from (`RdfMapper.sources`) or written
as, so that it can be removed again, whoever wrote it.
"""

from __future__ import annotations

import sqlite3
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import Any, TypeAlias

from armor_service.store.unique_names import ListWords, different_lists
from owl_reasoner.documents.mapping import DECLARATIONS, RdfMapper
from owl_reasoner.documents.rdf_xml import Graph, Node, Triple
from owl_reasoner.documents.triples import KIND_TYPES, NODE, axiom_triples
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, SWRL, THING, XSD
from owl_reasoner.owlready.quads import lexical_form, stored_value

Quad: TypeAlias = tuple[Any, ...]
"""``(s, p, o)`` of a relation, ``(s, p, value, datatype)`` of a value, in owlready2's numbers."""
RESERVED = 300
"""The largest number that owlready2 keeps for the words of OWL."""
_TYPE = RDF + 'type'
_BUILT_IN = (OWL, RDF, RDFS, XSD, SWRL)
_AXIOM = OWL + 'Axiom'
_OBJECT_PROPERTY, _DATA_PROPERTY = frozenset(('object_property',)), frozenset(('data_property',))


class WorldNames:
    """Numbers and names of a World's file; new numbers come from the file's own counters.

    Args:
        db: The file.

    Attributes:
        names: The names that are known, by their numbers.
    """

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db
        self._numbers: dict[str, int] = {}
        self.names: dict[int, str] = {}
        self._new: list[str] = []

    def read_all(self, renamed: Iterable[tuple[int, str]] = ()) -> None:
        """Ask for all names at once; know some by the names that they had before."""
        self.names.update(self._db.execute('SELECT storid, iri FROM resources'))
        # Of several the first: that is how it was.
        self.names.update(reversed([*renamed]))
        self._numbers = {name: number for number, name in self.names.items()}

    def number(self, name: str) -> int:
        """Return the number of a name, a new one where it has none."""
        found = self._numbers.get(name)
        if found is None:
            execute = self._db.execute
            row = execute('SELECT storid FROM resources WHERE iri=?', (name,)).fetchone()
            if row is None:
                execute('UPDATE store SET current_resource=current_resource+1')
                row = execute('SELECT current_resource FROM store').fetchone()
                execute('INSERT INTO resources VALUES (?, ?)', (row[0], name))
                self._new.append(name)
            found = self._numbers[name] = row[0]
            self.names[found] = name
        return found

    def find(self, name: str) -> int:
        """Return the number of a name; 0 where it has none."""
        if name not in self._numbers:
            row = self._db.execute('SELECT storid FROM resources WHERE iri=?', (name,)).fetchone()
            if row is None:
                return 0
            self._numbers[name], self.names[row[0]] = row[0], name
        return self._numbers[name]

    def name(self, number: int) -> str:
        """Return the name of a number; '' where it has none."""
        found = self.names.get(number)
        if found is None:
            row = self._db.execute('SELECT iri FROM resources WHERE storid=?', (number,)).fetchone()
            if row is None:
                return ''
            found = self.names[number] = row[0]
            self._numbers[row[0]] = number
        return found

    def new_node(self) -> int:
        """Return the number of a new node without a name."""
        self._db.execute('UPDATE store SET current_blank=current_blank+1')
        return -int(self._db.execute('SELECT current_blank FROM store').fetchone()[0])

    def remember(self, number: int, name: str) -> None:
        """Know the name that a number had until somebody else took it away."""
        self.names.setdefault(number, name)

    def forget(self, number: int) -> None:
        """Ask anew for a number that somebody else changed."""
        self._numbers.pop(self.names.pop(number, ''), None)

    def committed(self) -> None:
        """Keep the numbers that were given out since the last call."""
        self._new.clear()

    def rolled_back(self) -> None:
        """Forget the numbers that were given out since."""
        for name in self._new:
            self.names.pop(self._numbers.pop(name, 0), None)
        self._new.clear()


@dataclass(slots=True)
class AxiomQuads:
    """Where an axiom stands that is not plain.

    Attributes:
        nodes: Nodes without a name all of whose quads are its.
        quads: Further quads.
    """

    nodes: tuple[int, ...] = ()
    quads: tuple[Quad, ...] = ()


@dataclass(slots=True)
class AxiomsRead:
    """What was read.

    Attributes:
        added: Axioms that came.
        removed: Axioms that went.
        problems: One sentence for each statement that is no OWL.
    """

    added: list[Axiom] = field(default_factory=list)
    removed: list[Axiom] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)


class WorldOntology:
    """One ontology of a World's file.

    Large because writing, removing and reading an axiom share what is known of its quads.

    Whoever calls it holds the transaction; after one that failed `rolled_back` is called.

    Args:
        db: The file.
        iri: The ontology's IRI, without ``#``.
        names: The file's names.
        declare: Declare what axioms name: without, owlready2 would not list it.

    Attributes:
        context: The number of the ontology in the file.
    """

    def __init__(
        self, db: sqlite3.Connection, iri: str, names: WorldNames, *, declare: bool = True
    ) -> None:
        self._db, self._iri, self._names = db, iri, names
        self._declares = declare
        self._base = iri if iri.endswith('/') else f'{iri}#'
        self.context = self._context()
        self._kinds: dict[str, frozenset[str]] = {}
        self._declared: set[tuple[str, str]] = set()
        self._labels: dict[str, int] = {}
        self._label_of: dict[int, str] = {}
        self._places: dict[Axiom, AxiomQuads] = {}
        self._shared: Counter[int | Quad] = Counter()
        self._undo: list[Callable[[], object]] = []
        self._new_labels: list[tuple[str, int]] = []
        # Without writing: these are among the names that every World has, or are not there.
        self._type, self._thing = names.find(_TYPE), names.find(THING)
        numbers = ((names.find(iri), kind) for iri, kind in DECLARATIONS.items())
        self._kind_types = {number: kind for number, kind in numbers if number}
        c = self.context
        self._statements = {
            3: (
                f'INSERT OR IGNORE INTO objs VALUES ({c}, ?, ?, ?)',
                f'DELETE FROM objs INDEXED BY index_objs_sp WHERE s=? AND p=? AND o=? AND c={c}',
            ),
            4: (
                f'INSERT OR IGNORE INTO datas VALUES ({c}, ?, ?, ?, ?)',
                'DELETE FROM datas INDEXED BY index_datas_sp '
                f'WHERE s=? AND p=? AND o=? AND d=? AND c={c}',
            ),
        }

    def _context(self) -> int:
        execute = self._db.execute
        base = self._base
        row = execute('SELECT c FROM ontologies WHERE iri=?', (base,)).fetchone()
        if row is None:
            # With a time: without, owlready2's `load` would look for a document.
            moment = "(julianday('now') - 2440587.5) * 86400"
            execute(f'INSERT INTO ontologies VALUES (NULL, ?, {moment})', (base,))
            row = execute('SELECT c FROM ontologies WHERE iri=?', (base,)).fetchone()
        return int(row[0])

    # --- transactions ---

    def write_labels(self) -> None:
        """Write which nodes are the individuals without a name."""
        if self._new_labels:
            rows = [pair for pair in self._new_labels if self._labels.get(pair[0]) == pair[1]]
            self._db.executemany('INSERT OR REPLACE INTO armor_nodes VALUES (?, ?)', rows)

    def committed(self) -> None:
        """Keep what is known since the last call."""
        self._undo.clear()
        self._new_labels.clear()

    def rolled_back(self) -> None:
        """Know again what was known then."""
        while self._undo:
            self._undo.pop()()

    # --- writing ---

    def write_header(self) -> None:
        """Say that there is such an ontology."""
        self._insert(self._header())

    def _header(self) -> Quad:
        # owlready2's number of an ontology is that of its IRI without the end.
        return self._number(self._base[:-1]), self._type, self._number(OWL + 'Ontology')

    def add_all(self, axioms: Iterable[Axiom]) -> None:
        """Write many axioms."""
        plain: dict[int, list[Quad]] = {3: [], 4: []}
        entities: dict[tuple[str, str], None] = {}
        for axiom in axioms:
            quad = self._plain(axiom)
            if quad is None:
                self._add_other(axiom)
            else:
                plain[len(quad)].append(quad)
            if self._declares:
                entities.update(dict.fromkeys(entities_of(axiom)))
        for kind, name in entities:
            if (quad := self._declaration(kind, name)) is not None:
                plain[3].append(quad)
        for size, quads in plain.items():
            self._db.executemany(self._statements[size][0], quads)

    def add(self, axiom: Axiom) -> None:
        """Write an axiom."""
        quad = self._plain(axiom)
        if quad is None:
            self._add_other(axiom)
        else:
            self._insert(quad)
        if self._declares:
            self.declare(axiom)

    def declare(self, axiom: Axiom) -> None:
        """Declare what an axiom names."""
        for kind, name in entities_of(axiom):
            is_new = kind not in self._kinds.get(name, ())
            if is_new and (quad := self._declaration(kind, name)) is not None:
                self._insert(quad)

    def remove(self, axiom: Axiom) -> None:
        """Take an axiom away; what it declared stays, see `forget`."""
        if isinstance(axiom, ax.Declaration):
            self._declare_only((axiom.kind, axiom.iri), remove=True)
            return
        places = self._places.pop(axiom, None)
        if places is not None:
            self._undo.append(lambda: self._places.__setitem__(axiom, places))
            self._clear(places)
        if (quad := self._plain(axiom)) is not None:
            gone = self._db.execute(self._statements[len(quad)][1], quad).rowcount
            if not gone and isinstance(axiom, ax.DataPropertyAssertion):
                # Somebody may have written the text where this would write a number.
                self._delete((*quad[:2], axiom.literal.lexical, quad[3]))

    def _clear(self, places: AxiomQuads) -> None:
        for node in places.nodes:
            if self._is_last(node):
                self._db.execute(f'DELETE FROM objs WHERE s=? AND c={self.context}', (node,))
                self._db.execute(f'DELETE FROM datas WHERE s=? AND c={self.context}', (node,))
        for quad in places.quads:
            if self._is_last(quad):
                self._delete(quad)

    def forget(self, kind: str, name: str) -> None:
        """Take the declaration of something away that no axiom names any more."""
        if kind in KIND_TYPES:
            self._delete((self._node(name), self._type, self._number(KIND_TYPES[kind])))
            self._kind(name, kind, there=False)

    def _is_last(self, place: int | Quad) -> bool:
        """Tell whether no other axiom stands in a node or quad, and count one less."""
        others = self._shared.get(place, 0)
        if others:
            self._shared[place] = others - 1
            self._undo.append(lambda: self._shared.__setitem__(place, others))
        return not others

    def _plain(self, axiom: Axiom) -> Quad | None:
        """Return the quad of a fact about individuals; None: it is another axiom."""
        kind = type(axiom)
        if kind is ax.DataPropertyAssertion:
            literal = axiom.literal  # type: ignore[attr-defined]
            subject, prop = axiom.subject, axiom.prop  # type: ignore[attr-defined]
            return self._node(subject), self._number(prop), *self._value(literal)
        if kind is ax.ObjectPropertyAssertion:
            subject, prop = axiom.subject, axiom.prop  # type: ignore[attr-defined]
            other = axiom.object  # type: ignore[attr-defined]
            return self._node(subject), self._number(prop), self._node(other)
        if kind is ax.ClassAssertion and isinstance(axiom.cls, str):  # type: ignore[attr-defined]
            individual, cls = axiom.individual, axiom.cls  # type: ignore[attr-defined]
            return self._node(individual), self._type, self._number(cls)
        return None

    def _add_other(self, axiom: Axiom) -> None:
        if isinstance(axiom, ax.Declaration):
            self._declare_only((axiom.kind, axiom.iri))
            return
        if axiom in self._places:
            return
        made: dict[str, int] = {}
        quads: list[Quad] = []
        triples = axiom_triples(axiom, self._iri)
        if isinstance(axiom, ax.AxiomAnnotation):
            triples = self._annotating(axiom, triples, made)
        for subject, predicate, value in triples:
            s, p = self._node(subject, made), self._number(predicate)
            if (predicate, value) == (_TYPE, SWRL + 'Variable'):
                self._insert((s, p, *self._value(value)))  # Rules share their variables.
            else:
                quads.append((s, p, *self._value(value, made)))
        for quad in quads:
            self._insert(quad)
        taken = {}
        if isinstance(axiom, ax.AxiomAnnotation) and axiom.axiom in self._places:
            taken = dict.fromkeys(self._places[axiom.axiom].nodes)
        own = {number: None for number in made.values() if number not in taken}
        rest = tuple(quad for quad in quads if quad[0] not in own)
        self._stand(axiom, AxiomQuads(tuple(own), rest))

    def _annotating(
        self, axiom: ax.AxiomAnnotation, triples: list[Triple], made: dict[str, int]
    ) -> list[Triple]:
        """Return the triples of an annotation alone, on the nodes that its axiom has."""
        stated = axiom_triples(axiom.axiom, self._iri)
        base = self._places.get(axiom.axiom)
        if base is not None:
            labels = (str(part) for one in stated for part in (one[0], one[2]))
            # Written, the nodes are in the order of their labels; read, the first of them is the
            # one that stands for all, and what a statement names is known from its quad.
            ordered = dict.fromkeys(label for label in labels if label[:3] == NODE)
            made.update(zip(ordered, base.nodes, strict=False))
            for quad in base.quads[-1:]:
                for label, number in ((stated[-1][0], quad[0]), (stated[-1][2], quad[2])):
                    if isinstance(label, str) and label[:3] == NODE:
                        made[label] = number
        return [triple for triple in triples if triple not in stated]

    def _stand(self, axiom: Axiom, places: AxiomQuads) -> None:
        before = self._places.get(axiom)
        self._places[axiom] = places
        if before is None:
            self._undo.append(lambda: self._places.pop(axiom, None))
        else:
            self._undo.append(lambda: self._places.__setitem__(axiom, before))

    def _declaration(self, kind: str, name: str) -> Quad | None:
        if kind not in KIND_TYPES or name.startswith((*_BUILT_IN, '_:')):
            return None
        self._kind(name, kind)
        return self._number(name), self._type, self._number(KIND_TYPES[kind])

    def _kind(self, name: str, kind: str, *, there: bool = True) -> None:
        before = self._kinds.get(name, frozenset())
        if there != (kind in before):
            self._kinds[name] = before ^ {kind}
            self._undo.append(lambda: self._kinds.__setitem__(name, before))

    def _declare_only(self, entity: tuple[str, str], *, remove: bool = False) -> None:
        """Remember that something is declared although nothing else is said of it."""
        if (entity in self._declared) != remove:
            return
        if remove:
            self._declared.discard(entity)
            self._undo.append(lambda: self._declared.add(entity))
            words = 'DELETE FROM armor_declared WHERE kind=? AND name=?'
        else:
            self._declared.add(entity)
            self._undo.append(lambda: self._declared.discard(entity))
            words = 'INSERT OR IGNORE INTO armor_declared VALUES (?, ?)'
            if (quad := self._declaration(*entity)) is not None:
                self._insert(quad)
        self._db.execute(words, entity)

    def _node(self, name: str, made: dict[str, int] | None = None) -> int:
        if name[:2] != '_:':
            return self._names.number(name)
        if made is not None and name.startswith(NODE):
            if name not in made:
                made[name] = self._names.new_node()
            return made[name]
        if name not in self._labels:
            self._label(name, self._names.new_node())
        return self._labels[name]

    def _label(self, name: str, number: int) -> None:
        self._labels[name], self._label_of[number] = number, name
        self._undo.append(lambda: (self._labels.pop(name, 0), self._label_of.pop(number, '')))
        self._new_labels.append((name, number))

    def _number(self, name: str) -> int:
        return self._names.number(name)

    def _insert(self, quad: Quad) -> None:
        self._db.execute(self._statements[len(quad)][0], quad)

    def _delete(self, quad: Quad) -> None:
        self._db.execute(self._statements[len(quad)][1], quad)

    # --- reading ---

    def read(
        self,
        come: Iterable[Quad] = (),
        gone: Iterable[Quad] = (),
        renamed: Iterable[tuple[int, str]] = (),
    ) -> AxiomsRead:
        """Read all axioms, as they were before somebody changed some.

        Args:
            come, gone: Quads that he wrote and took away.
            renamed: Numbers to which he gave another name, with the one before.
        """
        execute, c = self._db.execute, self.context
        self._names.read_all(renamed)
        self._labels = dict(execute('SELECT label, node FROM armor_nodes'))
        self._label_of = {number: label for label, number in self._labels.items()}
        self._declared = set(execute('SELECT kind, name FROM armor_declared'))
        self._places, self._undo = {}, []
        self._shared.clear()
        words = self._list_words()
        found = AxiomsRead()
        rest: list[Quad] = []
        without = set(come)
        put_back: dict[str, list[Quad]] = defaultdict(list)
        for quad in gone:
            put_back[self._part_of(quad, words)].append(quad)

        def rows(part: str, columns: str, table: str, where: str) -> Iterable[Quad]:
            query = f'SELECT {columns} FROM {table} NOT INDEXED WHERE c={c}{where} ORDER BY rowid'
            found = execute(query)
            there = (quad for quad in found if quad not in without) if without else found
            return chain(there, put_back[part])

        # Declarations first, by which the others are read; links of lists by themselves.
        links, kinds = words[-2:], ','.join(map(str, self._kind_types))
        declares = f'p={self._type} AND s>0 AND o IN ({kinds})'
        self._kinds = self._read_kinds(rows('kind', 's, p, o', 'objs', f' AND {declares}'))
        apart = f' AND p NOT IN {links} AND NOT ({declares})'
        objs = rows('relation', 's, p, o', 'objs', apart)
        datas = rows('value', 's, p, o, d', 'datas', '')
        odd = chain(self._read_relations(objs, found.added), self._read_values(datas, found.added))
        for quad in odd:
            axiom = self._fact(quad)
            if axiom is None:
                rest.append(quad)
            else:
                found.added.append(axiom)
        linked = list(rows('link', 's, p, o', 'objs', f' AND p IN {links}'))
        lists, rest = different_lists(rest, linked, words)
        others, found.problems = self._mapped(rest)
        others += dict.fromkeys(self._different(*one) for one in lists)
        found.added = [*others, *found.added]
        found.added += [ax.Declaration(*entity) for entity in sorted(self._declared)]
        self._undo.clear()
        return found

    def _list_words(self) -> ListWords:
        find = self._names.find
        members = frozenset((find(OWL + 'members'), find(OWL + 'distinctMembers')))
        type_, nil, first, rest = (find(RDF + name) for name in ('type', 'nil', 'first', 'rest'))
        return ListWords(type_, find(OWL + 'AllDifferent'), nil, members, first, rest)

    def _different(self, members: list[int], nodes: tuple[int, ...]) -> Axiom:
        axiom = ax.DifferentIndividuals(frozenset(map(self._names.name, members)))
        before = self._places.get(axiom, AxiomQuads())
        self._stand(axiom, AxiomQuads((*before.nodes, *nodes), before.quads))
        return axiom

    def _part_of(self, quad: Quad, words: ListWords) -> str:
        """Return in which part of the quads `read` comes upon one."""
        if len(quad) == 4:
            return 'value'
        if quad[1] in words[-2:]:
            return 'link'
        declares = quad[1] == self._type and quad[0] > 0 and quad[2] in self._kind_types
        return 'kind' if declares else 'relation'

    def _read_kinds(self, quads: Iterable[Quad]) -> dict[str, frozenset[str]]:
        """Return as what each name is declared."""
        kinds: dict[str, frozenset[str]] = {}
        name = self._names.name
        alone = {number: frozenset((kind,)) for number, kind in self._kind_types.items()}
        for s, _, o in quads:
            declared, only = name(s), alone[o]
            kinds[declared] = kinds[declared] | only if declared in kinds else only
        return kinds

    def _read_relations(self, quads: Iterable[Quad], found: list[Axiom]) -> Iterator[Quad]:
        """Read relations of individuals that have names, as `_fact` does; yield other quads."""
        names, relating = self._names.names, self._numbers_of(_OBJECT_PROPERTY)
        for quad in quads:
            s, p, o = quad
            if p in relating and s > RESERVED and o > RESERVED:
                found.append(ax.ObjectPropertyAssertion(relating[p], names[s], names[o]))
            else:
                yield quad

    def _read_values(self, quads: Iterable[Quad], found: list[Axiom]) -> Iterator[Quad]:
        """Read values of individuals that have names, as `_fact` does; yield other quads."""
        names, valued = self._names.names, self._numbers_of(_DATA_PROPERTY)
        for quad in quads:
            s, p, value, datatype = quad
            if p in valued and s > RESERVED and datatype in names:
                name = names[datatype]
                literal = Literal(lexical_form(value, name), name)
                found.append(ax.DataPropertyAssertion(valued[p], names[s], literal))
            else:
                yield quad

    def _numbers_of(self, kinds: frozenset[str]) -> dict[int, str]:
        """Return the numbers and names of what is declared as this and nothing else."""
        return {self._number(name): name for name, found in self._kinds.items() if found == kinds}

    def _fact(self, quad: Quad) -> Axiom | None:
        """Return the fact that a quad states by itself; None where it takes part in another axiom.

        Of a declaration it is `_DECLARES`.
        """
        subject, predicate, value = quad[:3]
        if subject <= RESERVED and subject not in self._label_of:
            return None
        if len(quad) == 3:
            if value < 0 and value not in self._label_of:
                return None
            if predicate == self._type:
                if value in self._kind_types:
                    return _DECLARES if subject > 0 else None
                if (value <= RESERVED and value != self._thing) or value < 0:
                    return None
                return ax.ClassAssertion(self._name(value), self._name(subject))
            if predicate <= RESERVED or (value <= RESERVED and value not in self._label_of):
                return None
            name = self._names.name(predicate)
            if self._kinds.get(name) == _OBJECT_PROPERTY:
                return ax.ObjectPropertyAssertion(name, self._name(subject), self._name(value))
            return None
        if predicate <= RESERVED:
            return None
        name = self._names.name(predicate)
        if self._kinds.get(name) == _DATA_PROPERTY:
            return ax.DataPropertyAssertion(name, self._name(subject), self._literal(*quad[2:]))
        return None

    def _name(self, number: int) -> str:
        if number > 0:
            return self._names.name(number)
        label = self._label_of.get(number, f'_:b{-number}')
        # A document may have had the label for another node.
        return label if self._labels.get(label, number) == number else f'{label}_{-number}'

    def _literal(self, value: object, datatype: int | str) -> Literal:
        if isinstance(datatype, str):
            return Literal(str(value), RDF + 'langString', datatype.removeprefix('@'))
        name = self._names.name(datatype) if datatype else XSD + 'string'
        return Literal(lexical_form(value, name), name)

    def _mapped(self, quads: Iterable[Quad]) -> tuple[list[Axiom], list[str]]:
        """Read axioms that are not plain, and where each of them stands, from all their quads."""
        numbers: dict[str, int] = {}
        triples: list[Triple] = []
        of_node: dict[int, list[Quad]] = {}
        for quad in quads:
            value: Node = self._name(quad[2]) if len(quad) == 3 else self._literal(*quad[2:])
            subject = self._name(quad[0])
            for number, name in ((quad[0], subject), (quad[2], value)):
                if isinstance(number, int) and number < 0 and isinstance(name, str):
                    numbers[name] = number
            if quad[0] < 0:
                of_node.setdefault(quad[0], []).append(quad)
            triples.append((subject, self._names.name(quad[1]), value))
        mapper = RdfMapper(Graph(triples), self._iri)
        named = dict.fromkeys(part for one in triples for part in one if isinstance(part, str))
        mapper.read((kind, name) for name in named for kind in self._kinds.get(name, ()))
        axioms = [axiom for axiom in mapper.axioms if not isinstance(axiom, ax.Declaration)]
        individuals = {
            name for axiom in axioms for kind, name in entities_of(axiom) if name[:2] == '_:'
        }
        for name in individuals:
            if name in numbers and name not in self._labels:
                self._label(name, numbers[name])
        known: set[object] = set()
        for axiom in axioms:
            places = self._places_of(axiom, mapper.sources.get(axiom, ()), numbers, of_node)
            for place in [*places.nodes, *places.quads]:
                if place in known:
                    self._shared[place] += 1  # type: ignore[index]
                known.add(place)
            if places.nodes or places.quads:
                self._stand(axiom, places)
        return axioms, mapper.unsupported

    def _places_of(
        self,
        axiom: Axiom,
        sources: Iterable[str | Triple],
        numbers: Mapping[str, int],
        of_node: Mapping[int, list[Quad]],
    ) -> AxiomQuads:
        """Return where an axiom stands that was read from nodes and statements."""
        nodes: dict[int, None] = {}
        quads: list[Quad] = []
        pending: list[int] = []
        for source in sources:
            if isinstance(source, str):
                pending.append(numbers[source] if source in numbers else self._number(source))
                continue
            quad = self._quad(*source, numbers)
            quads.append(quad)
            pending += [quad[0], *([quad[2]] if len(quad) == 3 else [])]
        is_annotation = isinstance(axiom, ax.AxiomAnnotation)
        if is_annotation and not any(self._reifies(of_node.get(node, ())) for node in pending):
            # It stands on the node of its axiom.
            said = {(self._number(p), self._value(v)) for p, v in axiom.annotations}  # type: ignore[attr-defined]
            on = (quad for node in pending for quad in of_node.get(node, ()))
            return AxiomQuads((), tuple(quad for quad in on if (quad[1], quad[2:]) in said))
        while pending:
            node = pending.pop()
            if node < 0 and node not in nodes and node not in self._label_of:
                nodes[node] = None
                if not is_annotation:
                    pending += [q[2] for q in of_node.get(node, ()) if len(q) == 3]
        return AxiomQuads(tuple(nodes), tuple(quad for quad in quads if quad[0] not in nodes))

    def _reifies(self, quads: Iterable[Quad]) -> bool:
        axiom = self._names.find(_AXIOM)
        return any(quad[1] == self._type and quad[2] == axiom for quad in quads)

    def _quad(self, subject: str, predicate: str, value: Node, numbers: Mapping[str, int]) -> Quad:
        s = numbers[subject] if subject in numbers else self._number(subject)
        if isinstance(value, str) and value in numbers:
            return s, self._number(predicate), numbers[value]
        return s, self._number(predicate), *self._value(value)

    def _value(self, value: Node, made: dict[str, int] | None = None) -> Quad:
        if not isinstance(value, Literal):
            return (self._node(value, made),)
        language = value.language
        return stored_value(value), f'@{language}' if language else self._number(value.datatype)

    # --- what others changed ---

    def read_changes(self, come: Iterable[Quad], gone: Iterable[Quad]) -> AxiomsRead:
        """Read what others changed; what is known of the quads follows.

        Args:
            come, gone: The quads.
        """
        come, gone = list(come), list(gone)
        found = AxiomsRead()
        rest: list[tuple[Quad, bool]] = []
        changed = [(quad, True) for quad in come] + [(quad, False) for quad in gone]
        for quad, is_there in changed:
            # Kinds first: what else was written is read by them.
            types = len(quad) == 3 and quad[1] == self._type and quad[0] > RESERVED
            kind = self._kind_types.get(quad[2]) if types else None
            if kind is not None:
                name = self._name(quad[0])
                self._kind(name, kind, there=is_there)
                declaration = ax.Declaration(kind, name)
                (found.added if is_there else found.removed).append(declaration)
                self._declare_only((kind, name), remove=not is_there)
        for quad, is_there in changed:
            axiom = self._fact(quad)
            if axiom is None:
                rest.append((quad, is_there))
            elif axiom is not _DECLARES:
                (found.added if is_there else found.removed).append(axiom)
        if rest:
            self._read_rest(rest, found)
        return found

    def _read_rest(self, changed: list[tuple[Quad, bool]], found: AxiomsRead) -> None:
        nodes = {
            number
            for quad, _ in changed
            for number in (quad[0], quad[2] if len(quad) == 3 else 0)
            if number < 0 and number not in self._label_of
        }
        quads = dict.fromkeys(quad for quad, is_there in changed if is_there)
        component = self._component(nodes)
        quads.update(dict.fromkeys(component))
        nodes |= {quad[0] for quad in component if quad[0] < 0}
        gone = {quad for quad, is_there in changed if not is_there}
        owners = [
            axiom
            for axiom, places in self._places.items()
            if not nodes.isdisjoint(places.nodes) or any(quad in gone for quad in places.quads)
        ]
        owned = {axiom: self._places[axiom] for axiom in owners}
        for axiom, places in owned.items():
            del self._places[axiom]
            self._undo.append(partial(self._places.__setitem__, axiom, places))
            quads.update(dict.fromkeys(quad for quad in places.quads if quad not in gone))
        axioms, problems = self._mapped(quad for quad in quads if self._fact(quad) is None)
        if not any(is_there for _, is_there in changed):
            # owlready2 destroys what an axiom names and leaves the rest of it.
            problems = []
            for axiom in owners:
                if axiom not in axioms:
                    self._clear(owned[axiom])
        found.problems += problems
        now, before = dict.fromkeys(axioms), dict.fromkeys(owners)
        found.added += [axiom for axiom in now if axiom not in before]
        found.removed += [axiom for axiom in before if axiom not in now]

    def _component(self, nodes: set[int]) -> list[Quad]:
        """Return the quads that are there around some nodes, along nodes without a name."""
        execute, c = self._db.execute, self.context
        seen, pending = set(nodes), list(nodes)
        found: dict[Quad, None] = {}
        while pending:
            node = pending.pop()
            own = execute(f'SELECT s, p, o FROM objs WHERE s=? AND c={c}', (node,)).fetchall()
            own += execute(f'SELECT s, p, o FROM objs WHERE o=? AND c={c}', (node,)).fetchall()
            data = execute(f'SELECT s, p, o, d FROM datas WHERE s=? AND c={c}', (node,)).fetchall()
            found.update(dict.fromkeys((*own, *data)))
            for subject, _, value in own:
                for other in (subject, value):
                    if other < 0 and other not in seen and other not in self._label_of:
                        seen.add(other)
                        pending.append(other)
        return list(found)

    def renamed(self, axioms: Mapping[Axiom, Axiom], old: str, new: str) -> None:
        """Take in that somebody gave a name to what had another one."""
        for before, after in axioms.items():
            if (places := self._places.pop(before, None)) is not None:
                self._places[after] = places
        if old in self._kinds:
            self._kinds[new] = self._kinds.pop(old) | self._kinds.get(new, frozenset())
        for kind, name in [entity for entity in self._declared if entity[1] == old]:
            self._declare_only((kind, name), remove=True)
            self._declare_only((kind, new))

    def facts(self) -> dict[Quad, None]:
        """Return the quads that are there, for an ontology of derived facts."""
        execute, c = self._db.execute, self.context
        found = dict.fromkeys(execute(f'SELECT s, p, o FROM objs WHERE c={c}'))
        found.update(dict.fromkeys(execute(f'SELECT s, p, o, d FROM datas WHERE c={c}')))
        return found

    def become(self, axioms: Iterable[Axiom]) -> None:
        """Make plain facts all that is there."""
        present = self.facts()
        wanted = {quad: None for axiom in axioms if (quad := self._plain(axiom)) is not None}
        wanted[self._header()] = None
        for size in (3, 4):
            insert, delete = self._statements[size]
            come = [quad for quad in wanted if len(quad) == size and quad not in present]
            gone = [quad for quad in present if len(quad) == size and quad not in wanted]
            self._db.executemany(insert, come)
            self._db.executemany(delete, gone)

    def apply(self, come: Iterable[Quad], gone: Iterable[Quad]) -> None:
        """Write and take away quads as they are."""
        for quad in gone:
            self._delete(quad)
        for quad in come:
            self._insert(quad)

    def text(self, quad: Quad) -> Iterator[str]:
        """Yield subject, predicate and value of a quad as N-Triples has them."""
        for number in quad[: 3 if len(quad) == 3 else 2]:
            name = self._name(number)
            yield name if name[:2] == '_:' else f'<{name}>'
        if len(quad) == 4:
            literal = self._literal(*quad[2:])
            text = literal.lexical.replace('\\', '\\\\').replace('"', '\\"').replace('\n', '\\n')
            yield (
                f'"{text}"@{literal.language}'
                if literal.language
                else (f'"{text}"^^<{literal.datatype}>')
            )


_DECLARES = ax.Declaration('individual', '')
