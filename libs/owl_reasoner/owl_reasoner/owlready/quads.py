"""The quads of an owlready2 World as OWL axioms.

owlready2 (Lamy, "Owlready", Artificial Intelligence in Medicine 2017) keeps triples in SQLite: the
table ``objs`` with numbers for names (negative ones for nodes without a name), and ``datas`` with
values, of which whole and floating-point numbers are stored as such. `read_axioms` reads the axioms
of ontologies, whoever made them.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator
from decimal import Decimal
from typing import Any, TypeAlias

from owl_reasoner.documents.mapping import RdfMapper
from owl_reasoner.documents.rdf_xml import Graph, Node, Triple
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


def stored_value(literal: Literal) -> int | float | str:
    """Return what is stored of a literal beside its datatype.

    A number where owlready2 stores one and the literal is written as that number reads again; else
    its text, which owlready2 reads as the number, too.
    """
    value = _number(literal)
    return literal.lexical if value is None else value


def _number(literal: Literal) -> int | float | None:
    try:
        if literal.datatype in _WHOLE:
            whole = int(literal.lexical)
            fits = _SMALLEST <= whole <= _LARGEST and str(whole) == literal.lexical
            return whole if fits else None
        if literal.datatype in _FLOATING:
            value = float(literal.lexical)
            # SQLite has no value for what is no number.
            fits = math.isfinite(value) and lexical_form(value, literal.datatype) == literal.lexical
            return value if fits else None
    except ValueError:
        pass
    return None


def lexical_form(value: object, datatype: str) -> str:
    """Return the text of a stored value."""
    if isinstance(value, float) and datatype == XSD + 'decimal':
        # A decimal has no exponent.
        return format(Decimal(repr(value)), 'f')
    if isinstance(value, bool):
        return 'true' if value else 'false'
    return str(value)


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
