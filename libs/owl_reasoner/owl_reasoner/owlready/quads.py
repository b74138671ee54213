"""OWL axioms as the quads of an owlready2 World, and back.

owlready2 (Lamy, "Owlready", Artificial Intelligence in Medicine 2017) keeps triples in SQLite: the
table ``objs`` with numbers for names (negative ones for nodes without a name), and ``datas`` with
values, of which whole and floating-point numbers are stored as such. `OntologyWriter` keeps an
ontology of a World equal to a set of axioms, one change after the other; `read_axioms` reads the
axioms of ontologies, whoever made them.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator
from decimal import Decimal
from typing import Any, TypeAlias

from owl_reasoner.documents.mapping import RdfMapper
from owl_reasoner.documents.rdf_xml import Graph, Node, Triple
from owl_reasoner.documents.triples import KIND_TYPES, NODE, axiom_triples
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, SWRL, XSD

Quad: TypeAlias = tuple[Any, ...]
"""``(s, p, o)`` of a relation or ``(s, p, value, datatype)`` of a value, as owlready2 numbers them.
"""
_TYPE = RDF + 'type'
_BUILT_IN = (OWL, RDF, RDFS, XSD, SWRL)
_SMALLEST, _LARGEST = -(2**63), 2**63 - 1
_WHOLE = frozenset(
    XSD + name
    for name in (
        *('integer', 'byte', 'short', 'int', 'long', 'unsignedByte', 'unsignedShort'),
        *('unsignedInt', 'unsignedLong', 'negativeInteger', 'nonNegativeInteger'),
        'positiveInteger',
    )
)
_FLOATING = frozenset((XSD + 'decimal', XSD + 'double', XSD + 'float', OWL + 'real'))
_ALONE = (
    ax.ClassAssertion,
    ax.ObjectPropertyAssertion,
    ax.DataPropertyAssertion,
    ax.SubClassOf,
)
"""Axioms that share no triple with another axiom, if all that they name has a name."""


class UnknownQuadsError(LookupError):
    """What is to be taken away cannot be told from what stays: all has to be written anew."""


def stored_value(literal: Literal) -> int | float | str:
    """Return what owlready2 stores of a literal beside its datatype."""
    try:
        if literal.datatype in _WHOLE:
            number = int(literal.lexical)
            return number if _SMALLEST <= number <= _LARGEST else literal.lexical
        if literal.datatype in _FLOATING:
            value = float(literal.lexical)
            # SQLite has no value for what is no number.
            return value if math.isfinite(value) else literal.lexical
    except ValueError:
        pass
    return literal.lexical


def lexical_form(value: object, datatype: str) -> str:
    """Return the text of a stored value."""
    if isinstance(value, float) and datatype == XSD + 'decimal':
        # A decimal has no exponent.
        return format(Decimal(repr(value)), 'f')
    if isinstance(value, bool):
        return 'true' if value else 'false'
    return str(value)


class OntologyWriter:
    """Keeps one ontology of a World equal to a set of axioms.

    Nothing is committed here: the caller decides what is one transaction.

    Args:
        ontology: An ontology of owlready2, in a World that may be written.
        declare: Declare what axioms name: without, owlready2 would not list it.
    """

    def __init__(self, ontology: Any, *, declare: bool = True) -> None:
        self._ontology = ontology
        self._iri = str(ontology.base_iri).rstrip('#')
        self._declare = declare
        self._unnamed: dict[str, int] = {}
        self._nodes: dict[Axiom, list[Quad]] = {}

    def reopen(self, ontology: Any) -> None:
        """Go on with the same ontology in a World that was opened again."""
        self._ontology = ontology

    def replace_all(self, axioms: Iterable[Axiom]) -> None:
        """Write the ontology anew."""
        graph = self._ontology.graph
        for table in ('objs', 'datas'):
            graph.execute(f'DELETE FROM {table} WHERE c=?', (graph.c,))
        self._unnamed.clear()
        self._nodes.clear()
        header = self._number(OWL + 'Ontology')
        self._insert(self._ontology.storid, self._number(_TYPE), header)
        for axiom in axioms:
            self.add(axiom)

    def add(self, axiom: Axiom) -> None:
        """Write an axiom."""
        quads, has_nodes = self._quads(axiom)
        for quad in quads:
            self._insert(*quad)
        if has_nodes:
            self._nodes[axiom] = quads
        if self._declare:
            for kind, name in entities_of(axiom):
                if kind in KIND_TYPES and not name.startswith((*_BUILT_IN, '_:')):
                    kind_type = self._number(KIND_TYPES[kind])
                    self._insert(self._number(name), self._number(_TYPE), kind_type)

    def remove(self, axiom: Axiom) -> None:
        """Take an axiom away; what it declared stays, see `forget`.

        Raises:
            UnknownQuadsError: Its quads cannot be told; nothing has changed.
        """
        if isinstance(axiom, ax.Declaration):
            return
        quads = self._nodes.pop(axiom, None)
        if quads is None:
            if not isinstance(axiom, _ALONE):
                raise UnknownQuadsError(type(axiom).__name__)
            quads, has_nodes = self._quads(axiom)
            if has_nodes:
                raise UnknownQuadsError(type(axiom).__name__)
        for quad in quads:
            self._delete(*quad)

    def forget(self, kind: str, name: str) -> None:
        """Take the declaration of something away that no axiom names any more."""
        if kind in KIND_TYPES:
            kind_type = self._number(KIND_TYPES[kind])
            self._delete(self._number(name), self._number(_TYPE), kind_type)

    def _quads(self, axiom: Axiom) -> tuple[list[Quad], bool]:
        """Return the quads of an axiom, and whether there are nodes of expressions among them."""
        made: dict[str, int] = {}
        quads: list[Quad] = []
        for subject, predicate, value in axiom_triples(axiom, self._iri):
            s, p = self._node(subject, made), self._number(predicate)
            if isinstance(value, Literal):
                quads.append((s, p, stored_value(value), self._datatype(value)))
            elif (predicate, value) != (_TYPE, SWRL + 'Variable'):
                quads.append((s, p, self._node(value, made)))
            else:
                # Rules share their variables.
                self._insert(s, p, self._number(value))
        return quads, bool(made)

    def _node(self, name: str, made: dict[str, int]) -> int:
        if not name.startswith('_:'):
            return self._number(name)
        known = made if name.startswith(NODE) else self._unnamed
        if name not in known:
            known[name] = self._ontology.world.graph.new_blank_node()
        return known[name]

    def _number(self, name: str) -> int:
        number: int = self._ontology._abbreviate(name)
        return number

    def _datatype(self, literal: Literal) -> int | str:
        return f'@{literal.language}' if literal.language else self._number(literal.datatype)

    def _insert(self, *quad: Any) -> None:
        if len(quad) == 3:
            self._ontology._add_obj_triple_raw_spo(*quad)
        else:
            self._ontology._add_data_triple_raw_spod(*quad)

    def _delete(self, *quad: Any) -> None:
        if len(quad) == 3:
            self._ontology._del_obj_triple_raw_spo(*quad)
        else:
            self._ontology._del_data_triple_raw_spod(*quad)


class StoredNames:
    """What the numbers of a World stand for; asked of it once for each.

    Args:
        world: The World.
        known: What is known already, also of entities that are no more; it is added to.
    """

    def __init__(self, world: Any, known: dict[int, str] | None = None) -> None:
        self._world = world
        self._known = {} if known is None else known

    def __getitem__(self, number: int) -> str:
        if number < 0:
            return f'_:b{-number}'
        name = self._known.get(number)
        if name is None:
            name = self._known[number] = self._world._unabbreviate(number)
        return name

    def all(self) -> StoredNames:
        """Ask for all names at once."""
        self._known.update(self._world.graph.execute('SELECT storid, iri FROM resources'))
        return self

    def literal(self, value: object, datatype: int | str) -> Literal:
        """Return the literal that a stored value stands for."""
        if isinstance(datatype, str):
            return Literal(str(value), RDF + 'langString', datatype.removeprefix('@'))
        name = self[datatype] if datatype else XSD + 'string'
        return Literal(lexical_form(value, name), name)

    def triple(self, quad: Quad) -> Triple:
        """Return the triple of a quad."""
        value: Node = self[quad[2]] if len(quad) == 3 else self.literal(quad[2], quad[3])
        return self[quad[0]], self[quad[1]], value


def quads_of(world: Any, contexts: Iterable[int]) -> Iterator[Quad]:
    """Yield the quads of the ontologies with these numbers, in storage order."""
    chosen = ','.join(map(str, contexts))
    execute = world.graph.execute
    yield from execute(f'SELECT s, p, o FROM objs WHERE c IN ({chosen}) ORDER BY rowid').fetchall()
    yield from execute(
        f'SELECT s, p, o, d FROM datas WHERE c IN ({chosen}) ORDER BY rowid'
    ).fetchall()


def contexts_of(world: Any) -> list[int]:
    """Return the numbers of all ontologies of a World."""
    return [number for (number,) in world.graph.execute('SELECT c FROM ontologies')]


def read_axioms(
    world: Any,
    contexts: Iterable[int],
    without: Container[Quad] = (),
    known: dict[int, str] | None = None,
) -> RdfMapper:
    """Read the axioms of ontologies.

    Args:
        world: The World.
        contexts: The numbers of the ontologies in it.
        without: Quads that are left out.
        known: Filled with what the numbers stand for.

    Returns:
        What was read: its ``axioms``, what it ``declared``, and in ``unsupported`` one sentence for
        each statement that was not understood.
    """
    names = StoredNames(world, known).all()
    triples = [names.triple(quad) for quad in quads_of(world, contexts) if quad not in without]
    mapping = RdfMapper(Graph(triples))
    mapping.read()
    return mapping
