"""OWL 2's structural specification: constructs by name, and the axioms that they make.

The functional syntax and OWL/XML both write these constructs; an axiom that is not understood costs
itself alone and is reported with its line (https://www.w3.org/TR/owl2-syntax/, with SWRL rules).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, TypeAlias, get_args

from owl_reasoner.documents.xml_reading import IllFormedError, OntologyFileError
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom, Declaration, Import
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, SWRL, SWRLB, XSD

Make: TypeAlias = Callable[[Any], Any]
PREFIXES = {'owl': OWL, 'rdf': RDF, 'rdfs': RDFS, 'xsd': XSD, 'swrl': SWRL, 'swrlb': SWRLB}
"""What a document need not declare."""
MOST_DIGITS = 18
"""Of a number in a cardinality."""


_LETTERS = (
    'A-Za-z_\xc0-\xd6\xd8-\xf6\xf8-\u02ff\u0370-\u037d\u037f-\u1fff\u200c\u200d\u2070-\u218f'
    '\u2c00-\u2fef\u3001-\ud7ff\uf900-\ufdcf\ufdf0-\ufffd\U00010000-\U000effff'
)
_LABEL = re.compile(f'_:[{_LETTERS}0-9]([{_LETTERS}0-9\xb7.-]*[{_LETTERS}0-9\xb7-])?')


def blank_label(text: str) -> str:
    """Return the label of an individual without a name, ``_:a``, if RDF can hold it.

    Raises:
        OntologyFileError: It cannot.
    """
    if not _LABEL.fullmatch(text):
        raise OntologyFileError(f'{text[:40]!r} is no label of an individual without a name')
    return text


@dataclass(frozen=True, slots=True)
class Call:
    """A construct: its name, its parts, and where it begins.

    A part is an IRI, a literal, a number, a construct, or a tuple of parts.
    """

    name: str
    parts: tuple[Any, ...]
    place: int


class Axioms:
    """Collects what constructs state.

    Args:
        line_of: Gives the line of a place.
        base: What the ontology is called where it has no name.

    Attributes:
        axioms: In document order.
        unsupported: One sentence for each axiom that was not understood.
        iri: The ontology's IRI, '' without one.
        prefixes: The prefixes that the document declares.
    """

    def __init__(self, line_of: Callable[[int], int], base: str) -> None:
        self._line_of, self._base = line_of, base
        self.axioms: dict[Axiom, None] = {}
        self.unsupported: list[str] = []
        self.iri = ''
        self.prefixes: dict[str, str] = {}

    @property
    def declared(self) -> Iterator[tuple[str, str]]:
        """Pairs (kind, IRI) of what the document declares."""
        return ((axiom.kind, axiom.iri) for axiom in self.axioms if isinstance(axiom, Declaration))

    @property
    def imports(self) -> Iterator[str]:
        """The IRIs of the ontologies that the document imports."""
        return (axiom.iri for axiom in self.axioms if isinstance(axiom, Import))

    def read(self, declared: Iterable[tuple[str, str]] = ()) -> None:
        """Nothing is left to read: each axiom says of what kind its names are."""

    @property
    def called(self) -> str:
        """The ontology's IRI, or what stands for it."""
        return self.iri or self._base

    def version(self, iri: str) -> None:
        """Take in the IRI of the ontology's version, which RDF has as an annotation."""
        self.axioms[ax.AnnotationAssertion(OWL + 'versionIRI', self.called, iri)] = None

    def named(self, name: str) -> str | None:
        """Return the IRI of a prefixed name; None where its prefix is not declared."""
        prefix, colon, local = name.partition(':')
        base = self.prefixes.get(prefix, PREFIXES.get(prefix))
        return base + local if colon and base is not None else None

    def add(self, call: Call) -> None:
        """Take in an axiom, or report it."""
        parts = [p for p in call.parts if not (isinstance(p, Call) and p.name == 'Annotation')]
        notes = [p for p in call.parts if isinstance(p, Call) and p.name == 'Annotation']
        try:
            if call.name == 'Annotation':
                prop, value = call.parts[-2:]
                axiom: Axiom = ax.AnnotationAssertion(prop, self.called, value)
            else:
                axiom = _AXIOMS[call.name](parts)
            hash(axiom)
        except KeyError as error:
            self._report(call, f'{error.args[0]} is not understood')
            return
        except (ValueError, TypeError, IndexError) as error:
            reason = str(error) if isinstance(error, IllFormedError) else 'its parts'
            self._report(call, f'{call.name} is not understood: {reason}')
            return
        self.axioms[axiom] = None
        if isinstance(axiom, ax.Import):
            return
        if any(not isinstance(part, str | Literal) for note in notes for part in note.parts):
            self._report(call, 'an annotation on an annotation is not kept')
        pairs = tuple(
            (note.parts[-2], note.parts[-1])
            for note in notes
            if len(note.parts) > 1 and all(isinstance(p, str | Literal) for p in note.parts[-2:])
        )
        if pairs and isinstance(axiom, ax.Rule):
            del self.axioms[axiom]
            self.axioms[ax.Rule(axiom.body, axiom.head, pairs)] = None
        elif pairs:
            self.axioms[ax.AxiomAnnotation(axiom, pairs)] = None

    def _report(self, call: Call, what: str) -> None:
        self.unsupported.append(f'line {self._line_of(call.place)}: {what}')


def _need(value: Any, kind: type, what: str) -> Any:
    if not isinstance(value, kind) or isinstance(value, bool):
        raise IllFormedError(f'expected {what}, got {value}')
    return value


def _prop(value: Any) -> ex.PropertyExpression:
    if isinstance(value, Call) and value.name == 'ObjectInverseOf' and len(value.parts) == 1:
        inner = _prop(value.parts[0])
        return inner.prop if isinstance(inner, ex.ObjectInverseOf) else ex.ObjectInverseOf(inner)
    iri: str = _need(value, str, 'an IRI')
    return iri


def _made(value: Any, makers: Mapping[str, Make], what: str) -> Any:
    """Return what a name stands for, or a call of one of the makers."""
    if isinstance(value, str):
        return value
    call = _need(value, Call, f'a {what}')
    make = makers.get(call.name)
    if make is None:
        raise IllFormedError(f'{call.name} is no {what}')
    return make(call.parts)


def _argument(value: Any) -> Any:
    if isinstance(value, Call) and value.name == 'Variable' and len(value.parts) == 1:
        return ex.Variable(_need(value.parts[0], str, 'an IRI'))
    return _need(value, str | Literal, 'a variable, an individual or a literal')  # type: ignore[arg-type]


_READ: dict[str, Make] = {
    'int': lambda value: _need(value, int, 'a number'),
    'str': lambda value: _need(value, str, 'an IRI'),
    'Literal': lambda value: _need(value, Literal, 'a literal'),
    'str | Literal': lambda value: _need(value, str | Literal, 'an IRI or a literal'),  # type: ignore[arg-type]
    'PropertyExpression': _prop,
    'ClassExpression': lambda value: _made(value, _CLASSES, 'class'),
    'DataRange': lambda value: _made(value, _RANGES, 'data range'),
    'IndividualArgument': _argument,
    'DataArgument': _argument,
}
"""How a part is read, by the type of the record's field that it is for."""
_SEVERAL = re.compile(r'(?:tuple|frozenset)\[(\w+)')


def _maker(record: Any) -> Make:
    """Return what makes a record of a construct: the parts are the fields, as both are OWL 2's.

    The last field takes the rest of the parts if it holds several.
    """
    *_, last = entries = fields(record)
    several = _SEVERAL.match(str(last.type))
    singles = [_READ[str(entry.type)] for entry in (entries[:-1] if several else entries)]
    optional = 0 if last.default is MISSING else 1
    fewest = 1 if record.__name__.endswith('OneOf') else 2

    def make(values: Any) -> Any:
        count = len(singles)
        own = values[:count] if several else values
        if not count - optional <= len(own) <= count:
            expected = f'{count - 1} or {count}' if optional else str(count)
            raise IllFormedError(f'expected {expected} parts, got {len(own)}')
        made = [read(value) for read, value in zip(singles, own, strict=False)]
        if several:
            rest = values[count:]
            if len(rest) < fewest:
                raise IllFormedError(f'expected at least {fewest} parts, got {len(rest)}')
            kind = tuple if str(last.type).startswith('tuple') else frozenset
            made.append(kind(map(_READ[several[1]], rest)))
        return record(*made)

    return make


def _makers(records: Iterable[Any]) -> dict[str, Make]:
    """Return the makers of records by the construct's name."""
    return {
        record.__name__: _maker(record)
        for record in records
        if hasattr(record, '__dataclass_fields__') and record.__name__ not in _OWN_FORM
    }


def _exactly(values: Any, count: int) -> Any:
    if len(values) != count:
        raise IllFormedError(f'expected {count} parts, got {len(values)}')
    return values


def _facets(values: Any) -> ex.DatatypeRestriction:
    names, bounds = map(_READ['str'], values[1::2]), map(_READ['Literal'], values[2::2])
    return ex.DatatypeRestriction(_READ['str'](values[0]), tuple(zip(names, bounds, strict=True)))


def _builtin(values: Any) -> ex.BuiltinAtom:
    return ex.BuiltinAtom(_READ['str'](values[0]), tuple(map(_argument, values[1:])))


def _rule(values: Any) -> ax.Rule:
    parts = (_need(part, Call, 'atoms').parts for part in _exactly(values, 2))
    atoms = ([_need(atom, Call, 'an atom') for atom in part] for part in parts)
    return ax.Rule(*(tuple(_ATOMS[atom.name](atom.parts) for atom in part) for part in atoms))


def _sub_property(values: Any) -> Axiom:
    sub, sup = _exactly(values, 2)
    if not isinstance(sub, Call) or sub.name != 'ObjectPropertyChain':
        return ax.SubObjectPropertyOf(_prop(sub), _prop(sup))
    if len(sub.parts) < 2:
        raise IllFormedError(f'expected at least 2 parts, got {len(sub.parts)}')
    return ax.SubPropertyChainOf(tuple(map(_prop, sub.parts)), _prop(sup))


def _declaration(values: Any) -> Axiom:
    call = _need(_exactly(values, 1)[0], Call, 'a kind of entity')
    (iri,) = _exactly(call.parts, 1)
    return ax.Declaration(_KINDS[call.name], _READ['str'](iri))


def _straight(
    record: type[ax.ObjectPropertyAssertion | ax.NegativeObjectPropertyAssertion],
) -> Make:
    """Return what makes an assertion without an inverse property."""

    def make(values: Any) -> Axiom:
        prop, subject, target = _exactly(values, 3)
        subject, target = _READ['str'](subject), _READ['str'](target)
        expression = _prop(prop)
        if isinstance(expression, ex.ObjectInverseOf):
            return record(expression.prop, target, subject)
        return record(expression, subject, target)

    return make


def _key(values: Any) -> Axiom:
    cls, objects, datas = _exactly(values, 3)
    data_props = tuple(map(_READ['str'], tuple(datas)))
    return ax.HasKey(_READ['ClassExpression'](cls), tuple(map(_prop, objects)), data_props)


def _about_property(name: str) -> Make:
    """Return an axiom of annotation properties, as an annotation of the property."""
    return lambda values: ax.AnnotationAssertion(
        RDFS + name, *map(_READ['str'], _exactly(values, 2))
    )


_KINDS = {
    'Class': 'class',
    'ObjectProperty': 'object_property',
    'DataProperty': 'data_property',
    'NamedIndividual': 'individual',
    'AnnotationProperty': 'annotation_property',
    'Datatype': 'datatype',
}
_OWN_FORM = {
    *('SubPropertyChainOf', 'HasKey', 'AxiomAnnotation', 'Rule'),
    *('ObjectInverseOf', 'DatatypeRestriction', 'BuiltinAtom'),
}
"""Records that are not made of a construct's parts one after the other."""
_CLASSES: dict[str, Make] = _makers(get_args(ex.ClassExpression))
_RANGES: dict[str, Make] = _makers(get_args(ex.DataRange)) | {'DatatypeRestriction': _facets}
_ATOMS = _makers(get_args(ex.Atom)) | {'BuiltInAtom': _builtin}
_AXIOMS: dict[str, Make] = {
    **_makers(r for r in vars(ax).values() if isinstance(r, type) and issubclass(r, Axiom)),
    'Declaration': _declaration,
    'SubObjectPropertyOf': _sub_property,
    'HasKey': _key,
    'ObjectPropertyAssertion': _straight(ax.ObjectPropertyAssertion),
    'NegativeObjectPropertyAssertion': _straight(ax.NegativeObjectPropertyAssertion),
    'SubAnnotationPropertyOf': _about_property('subPropertyOf'),
    'AnnotationPropertyDomain': _about_property('domain'),
    'AnnotationPropertyRange': _about_property('range'),
    'DLSafeRule': _rule,
}
