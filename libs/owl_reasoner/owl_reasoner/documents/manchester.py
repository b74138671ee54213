"""OWL 2 in Manchester syntax, read and written (https://www.w3.org/TR/owl2-manchester-syntax/).

Rules are ``Rule: ROOM(?r), hasDoor(?r, ?d) -> Open(?r)``, as Protege has them; a built-in stands by
its name behind ``swrlb:`` or without. A general class axiom has its expression in the place of the
class: ``Class: A and B SubClassOf: C``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias, TypeVar

from owl_reasoner.documents.structural import PREFIXES, Axioms
from owl_reasoner.documents.xml_reading import DEEPEST, OntologyFileError, is_absolute
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.expressions import Literal, language_tag
from owl_reasoner.owl.vocabulary import (
    OWL,
    RDF,
    RDFS,
    SWRLB,
    THING,
    TOP_LITERAL,
    XSD,
    local_name,
)

T = TypeVar('T')
_Notes: TypeAlias = 'tuple[tuple[str, str | Literal], ...]'
_TOKENS = re.compile(
    r'\s+|(?<!\S)\#[^\n]*'
    r'|(?P<iri><[^<>\s]*>)'
    r'|(?P<string>"[^"\\]*+(?:\\.[^"\\]*+)*+")'
    r'|(?P<mark>\^\^|->|>=|<=|[()\[\]{},<>])'
    r'|(?P<language>@[A-Za-z][\w-]*)'
    r'|(?P<variable>\?(?:<[^<>\s]*>|[\w:.#/-]+))'
    r'|(?P<number>[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?[fF]?(?![\w:]))'
    r'|(?P<keyword>[A-Za-z]+:(?=\s|$|[<"(]))'
    r'|(?P<name>[^\s()\[\]{},<>"^@]+)',
    re.DOTALL,
)
_FACETS = {
    **{'>=': 'minInclusive', '<=': 'maxInclusive', '>': 'minExclusive', '<': 'maxExclusive'},
    **{word: word for word in ('length', 'minLength', 'maxLength', 'pattern')},
    'langRange': 'langRange',
}
_SIGNS = {XSD + name: sign for sign, name in _FACETS.items()}
_DATATYPES = {name: XSD + name for name in ('integer', 'decimal', 'float', 'string')}
_COUNTS: dict[str, tuple[Any, Any]] = {
    'min': (ex.ObjectMinCardinality, ex.DataMinCardinality),
    'max': (ex.ObjectMaxCardinality, ex.DataMaxCardinality),
    'exactly': (ex.ObjectExactCardinality, ex.DataExactCardinality),
}
_RESTRICTIONS = ('some', 'only', 'value', 'Self', *_COUNTS)
_CHARACTERISTICS: dict[str, Any] = {
    'Functional': ax.FunctionalObjectProperty,
    'InverseFunctional': ax.InverseFunctionalObjectProperty,
    'Reflexive': ax.ReflexiveObjectProperty,
    'Irreflexive': ax.IrreflexiveObjectProperty,
    'Symmetric': ax.SymmetricObjectProperty,
    'Asymmetric': ax.AsymmetricObjectProperty,
    'Transitive': ax.TransitiveObjectProperty,
}
_WORDS = frozenset(
    (
        *('and', 'or', 'not', 'that', 'inverse', 'o', 'true', 'false', *_RESTRICTIONS),
        *('sameAs', 'SameAs', 'differentFrom', 'DifferentFrom', *_DATATYPES, *_FACETS),
    )
)
"""What a name alone may not be."""
_FRAMES = {
    'Class': 'class',
    'ObjectProperty': 'object_property',
    'DataProperty': 'data_property',
    'AnnotationProperty': 'annotation_property',
    'Datatype': 'datatype',
    'Individual': 'individual',
}
_LISTS = ('EquivalentClasses', 'DisjointClasses', 'EquivalentProperties', 'DisjointProperties')
_SETS: dict[str, Any] = {
    'SameIndividual': ax.SameIndividual,
    'DifferentIndividuals': ax.DifferentIndividuals,
}
_RULES = ('Rule', 'DLSafeRule')
_BUILT_IN = (OWL, RDF, RDFS, XSD)
_HEADS = (*_FRAMES, *_LISTS, *_SETS, *_RULES, 'Prefix', 'Ontology', 'Import')
MOST_DIGITS = 18


class _Token(NamedTuple):
    kind: str
    text: str
    place: int


class _Tokens:
    """The tokens of a text and the place where a parser is; reads what is one name or value.

    Args:
        text: The text.
        named: Gives the IRI of a name; raises ValueError.

    Attributes:
        at: The place, counted in tokens; a parser that looked ahead in vain sets it back.
    """

    def __init__(self, text: str, named: Callable[[str], str]) -> None:
        self.named = named
        self._text = text
        self._all = list(self._tokenized())
        self.at = 0

    def _tokenized(self) -> Iterator[_Token]:
        place = 0
        while place < len(self._text):
            match = _TOKENS.match(self._text, place)
            if match is None:
                raise self.error('a name', place)
            if match.lastgroup:
                yield _Token(match.lastgroup, match[0], place)
            place = match.end()
        yield _Token('end', '', len(self._text))

    @property
    def next(self) -> _Token:
        """The token at the place."""
        return self._all[self.at]

    @property
    def after(self) -> _Token:
        """The token behind the next one; at the end the end itself."""
        return self._all[min(self.at + 1, len(self._all) - 1)]

    def take(self, *texts: str) -> _Token:
        """Go past the next token and return it; `texts`: it must be one of these."""
        token = self.next
        if texts and token.text not in texts:
            raise self.error(' or '.join(map(repr, texts)))
        self.at += 1
        return token

    @property
    def line(self) -> int:
        """The line of the next token, the first one is 1."""
        return self._text.count('\n', 0, self.next.place) + 1

    def error(self, expected: str, place: int | None = None) -> OntologyFileError:
        """Return the error that something else was expected; `place`: in characters."""
        if place is None:
            place = self.next.place
        shown = self._text[place : place + 20].split('\n')[0] or 'the end'
        line = self._text.count('\n', 0, place) + 1
        column = place - (self._text.rfind('\n', 0, place) + 1) + 1
        return OntologyFileError(f'expected {expected}, got {shown!r}', line, column)

    def is_next(self, *texts: str) -> bool:
        """Tell whether the next token is one of some words; a text in quotes is none."""
        token = self.next
        return token.text in texts and token.kind in ('name', 'mark', 'keyword')

    def accept(self, *texts: str) -> bool:
        """Go past the next token if it is one of some words."""
        if self.is_next(*texts):
            self.at += 1
            return True
        return False

    def iri(self, what: str = 'a name') -> str:
        """Read a name or an IRI in brackets; `what`: for messages."""
        token = self.next
        if token.kind == 'iri':
            iri = token.text[1:-1]
            if not is_absolute(iri):
                raise self.error('a full IRI')
        elif token.kind in ('name', 'number'):
            try:
                iri = self.named(token.text)
            except ValueError as error:
                raise self.error(f'{what} ({error})') from None
        else:
            raise self.error(what)
        self.at += 1
        return iri

    def number(self) -> int:
        token = self.take()
        if not token.text.isdigit() or len(token.text) > MOST_DIGITS:
            raise self.error('a whole number', token.place)
        return int(token.text)

    def at_literal(self) -> bool:
        return self.next.kind in ('string', 'number') or self.is_next('true', 'false')

    def literal(self) -> Literal:
        token = self.take()
        if token.text in ('true', 'false'):
            return Literal(token.text, XSD + 'boolean')
        if token.kind == 'number':
            text = token.text
            if text[-1] in 'fF':
                return Literal(text[:-1], XSD + 'float')
            kind = 'double' if 'e' in text.lower() else 'decimal' if '.' in text else 'integer'
            return Literal(text, XSD + kind)
        if token.kind != 'string':
            raise self.error('a value', token.place)
        text = re.sub(r'\\(.)', r'\1', token.text[1:-1], flags=re.DOTALL)
        if self.next.kind == 'language':
            return Literal(text, RDF + 'langString', language_tag(self.take().text[1:]))
        if self.accept('^^'):
            if self.next.text in _DATATYPES:
                return Literal(text, _DATATYPES[self.take().text])
            return Literal(text, self.iri('a datatype'))
        return Literal(text)


class ManchesterParser:
    """Reads class expressions, frames and rules.

    Large because it has one method for each production of the grammar.

    Args:
        text: The text.
        named: Gives the IRI of a name, prefixed or not; raises ValueError.
        kinds: What is known of names: (kind, IRI).

    Attributes:
        unsupported: One sentence for each annotation that axioms do not hold.

    Raises:
        OntologyFileError: From every method, with line and column: what was expected.
    """

    def __init__(
        self, text: str, named: Callable[[str], str], kinds: Iterable[tuple[str, str]] = ()
    ) -> None:
        self._tokens = _Tokens(text, named)
        self._kinds = set(kinds)
        self._depth = 0
        self.unsupported: list[str] = []

    def _several(self, read: Callable[[], T]) -> list[T]:
        """Read a list with commas."""
        found = [read()]
        while self._tokens.accept(','):
            found.append(read())
        return found

    def _annotated(self, read: Callable[[], T]) -> list[tuple[_Notes, T]]:
        """Read a list with commas whose members may have annotations in front of them."""
        return self._several(lambda: (self._notes(), read()))

    def _notes(self) -> _Notes:
        """Read the annotations in front of what they annotate."""
        found: list[tuple[str, str | Literal]] = []
        while self._tokens.accept('Annotations:'):
            self._depth += 1
            if self._depth > DEEPEST:
                raise self._tokens.error(f'annotations that nest no deeper than {DEEPEST}')
            line = self._tokens.line
            for inner, note in self._annotated(self._annotation):
                found.append(note)
                if inner:
                    told = f'line {line}: an annotation on an annotation is not kept'
                    self.unsupported.append(told)
            self._depth -= 1
        return tuple(found)

    def _annotation(self) -> tuple[str, str | Literal]:
        prop = self._tokens.iri('an annotation property')
        at_value = self._tokens.at_literal()
        return prop, self._tokens.literal() if at_value else self._tokens.iri()

    def annotations(self, subject: str) -> Iterator[Axiom]:
        """Read the annotations of a header or frame, of which the first word may be read."""
        for notes, (prop, value) in self._annotated(self._annotation):
            yield from _noted(notes, ax.AnnotationAssertion(prop, subject, value))

    def header(self, iri: str) -> Iterator[Axiom]:
        """Read the annotations of an ontology's header."""
        while self._tokens.accept('Annotations:'):
            yield from self.annotations(iri)

    # --- expressions ---

    def whole(self, read: Callable[[], Any]) -> Any:
        """Read what the text as a whole holds."""
        found = read()
        if self._tokens.next.kind != 'end':
            raise self._tokens.error('the end')
        return found

    def class_expression(self) -> ex.ClassExpression:
        """Read ``A and (p some B) or not C``."""
        found: ex.ClassExpression = self._nested(
            'or', ex.ObjectUnionOf, lambda: self._joined('and', ex.ObjectIntersectionOf)
        )
        return found

    def _joined(self, word: str, record: Any) -> Any:
        parts = [self._primary()]
        while self._tokens.accept(word, 'that'):
            parts.append(self._primary())
        return parts[0] if len(parts) == 1 else record(tuple(parts))

    def _nested(self, word: str, record: Any, read: Callable[[], Any]) -> Any:
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._tokens.error(f'expressions that nest no deeper than {DEEPEST}')
        parts = [read()]
        while self._tokens.accept(word):
            parts.append(read())
        self._depth -= 1
        return parts[0] if len(parts) == 1 else record(tuple(parts))

    def _primary(self) -> ex.ClassExpression:
        if self._tokens.accept('not'):
            return ex.ObjectComplementOf(self._primary())
        if self._tokens.is_next('('):
            before = self._tokens.at
            self._tokens.take('(')
            if self._tokens.is_next('inverse'):
                self._tokens.at = before
                return self._restriction()
            found = self.class_expression()
            self._tokens.take(')')
            return found
        if self._tokens.accept('{'):
            individuals = self._several(self._tokens.iri)
            self._tokens.take('}')
            return ex.ObjectOneOf(tuple(individuals))
        follows = self._tokens.after
        if self._tokens.is_next('inverse') or follows.text in _RESTRICTIONS:
            return self._restriction()
        return self._tokens.iri('a class')

    def _property(self) -> ex.PropertyExpression:
        brackets = self._tokens.accept('(')
        if not self._tokens.accept('inverse'):
            return self._tokens.iri('a property')
        inner = self._tokens.accept('(')
        prop = ex.ObjectInverseOf(self._tokens.iri('a property'))
        for open_one in (inner, brackets):
            if open_one:
                self._tokens.take(')')
        return prop

    def _restriction(self) -> ex.ClassExpression:
        prop = self._property()
        word = self._tokens.take(*_RESTRICTIONS).text
        if word == 'Self':
            return ex.ObjectHasSelf(prop)
        if word == 'value':
            if self._tokens.at_literal():
                return ex.DataHasValue(str(prop), self._tokens.literal())
            return ex.ObjectHasValue(prop, self._tokens.iri('an individual'))
        count = self._tokens.number() if word in _COUNTS else 0
        if self._is_data(prop):
            return self._of_values(str(prop), word, count)
        if word in _COUNTS:
            record = _COUNTS[word][0]
            made: ex.ClassExpression = record(count, prop, self._filler(THING, self._primary))
            return made
        quantified = ex.ObjectSomeValuesFrom if word == 'some' else ex.ObjectAllValuesFrom
        return quantified(prop, self._primary())

    def _of_values(self, prop: str, word: str, count: int) -> ex.ClassExpression:
        if word in _COUNTS:
            ranged = self._filler(TOP_LITERAL, self._data_primary)
            made: ex.ClassExpression = _COUNTS[word][1](count, prop, ranged)
            return made
        data = ex.DataSomeValuesFrom if word == 'some' else ex.DataAllValuesFrom
        return data(prop, self._data_primary())

    def _filler(self, default: Any, read: Callable[[], Any]) -> Any:
        begins = self._tokens.next.kind in ('iri', 'name') or self._tokens.is_next('(', '{', 'not')
        return read() if begins and not self._tokens.is_next('and', 'or', 'that') else default

    def _is_data(self, prop: ex.PropertyExpression) -> bool:
        """Tell whether a property has values: by its declaration, else by what stands behind it."""
        if not isinstance(prop, str) or ('object_property', prop) in self._kinds:
            return False
        if ('data_property', prop) in self._kinds:
            return True
        token = self._tokens.next
        if token.text == '{':
            token = self._tokens.after
            return token.kind in ('string', 'number') or token.text in ('true', 'false')
        if token.kind not in ('iri', 'name') or token.text in ('and', 'or', 'not'):
            return False
        if token.text in _DATATYPES:
            return True
        before = self._tokens.at
        try:
            iri = self._tokens.iri()
        except OntologyFileError:
            return False
        finally:
            self._tokens.at = before
        is_range = ('datatype', iri) in self._kinds
        return is_range or iri.startswith(XSD) or iri in (RDFS + 'Literal', RDF + 'PlainLiteral')

    # --- data ---

    def data_range(self) -> ex.DataRange:
        """Read ``integer[>= 0] or {"a"}``."""
        found: ex.DataRange = self._nested('or', ex.DataUnionOf, self._data_joined)
        return found

    def _data_joined(self) -> ex.DataRange:
        parts = [self._data_primary()]
        while self._tokens.accept('and'):
            parts.append(self._data_primary())
        return parts[0] if len(parts) == 1 else ex.DataIntersectionOf(tuple(parts))

    def _data_primary(self) -> ex.DataRange:
        if self._tokens.accept('not'):
            return ex.DataComplementOf(self._data_primary())
        if self._tokens.accept('('):
            found = self.data_range()
            self._tokens.take(')')
            return found
        if self._tokens.accept('{'):
            literals = self._several(self._tokens.literal)
            self._tokens.take('}')
            return ex.DataOneOf(tuple(literals))
        if self._tokens.next.text in _DATATYPES:
            datatype = _DATATYPES[self._tokens.take().text]
        else:
            datatype = self._tokens.iri('a datatype')
        if not self._tokens.accept('['):
            return datatype
        facets = self._several(self._facet)
        self._tokens.take(']')
        return ex.DatatypeRestriction(datatype, tuple(facets))

    def _facet(self) -> tuple[str, Literal]:
        word = self._tokens.take(*_FACETS).text
        space = RDF if word == 'langRange' else XSD
        return space + _FACETS[word], self._tokens.literal()

    # --- rules ---

    def rule(self) -> ax.Rule:
        """Read ``ROOM(?r), hasDoor(?r, ?d) -> Open(?r)``."""
        notes = self._notes()
        body = [] if self._tokens.is_next('->') else self._several(self._atom)
        self._tokens.take('->')
        head = [] if self._tokens.next.kind in ('end', 'keyword') else self._several(self._atom)
        return ax.Rule(tuple(body), tuple(head), notes)

    def _atom(self) -> Any:
        if self._tokens.is_next('sameAs', 'SameAs', 'differentFrom', 'DifferentFrom'):
            same = self._tokens.take().text.lower() == 'sameas'
            first, second = self._arguments(2)
            record = ex.SameIndividualAtom if same else ex.DifferentIndividualsAtom
            return record(first, second)
        token = self._tokens.next
        if token.kind == 'name' and self._tokens.after.text == '(':
            name = token.text.removeprefix('swrlb:')
            if name != token.text or self._is_builtin(name):
                self._tokens.take()
                return ex.BuiltinAtom(SWRLB + name, tuple(self._arguments(0)))
            predicate: Any = self._tokens.iri('a class, property or built-in')
        elif token.kind == 'iri' and self._tokens.after.text == '(':
            predicate = self._tokens.iri()
            if predicate.startswith(SWRLB):
                return ex.BuiltinAtom(predicate, tuple(self._arguments(0)))
        else:
            predicate = self._primary()
        arguments = self._arguments(0)
        if len(arguments) == 1:
            is_range = isinstance(predicate, str) and (
                ('datatype', predicate) in self._kinds or predicate.startswith(XSD)
            )
            return (ex.DataRangeAtom if is_range else ex.ClassAtom)(predicate, arguments[0])
        if len(arguments) != 2 or not isinstance(predicate, str):
            raise self._tokens.error('one or two arguments', token.place)
        data = ('data_property', predicate) in self._kinds or isinstance(arguments[1], Literal)
        record2: Any = ex.DataPropertyAtom if data else ex.ObjectPropertyAtom
        return record2(predicate, *arguments)

    def _is_builtin(self, name: str) -> bool:
        from owl_reasoner.reasoner.swrl_builtins import builtin

        if any(builtin(name, count) for count in range(1, 5)):
            try:
                iri = self._tokens.named(name)
            except ValueError:
                return True
            return not any(known == iri for _, known in self._kinds)
        return False

    def _arguments(self, count: int) -> list[Any]:
        self._tokens.take('(')
        found = self._several(self._argument)
        if count and len(found) != count:
            raise self._tokens.error(f'{count} arguments')
        self._tokens.take(')')
        return found

    def _argument(self) -> Any:
        if self._tokens.next.kind == 'variable':
            name = self._tokens.take().text[1:]
            return ex.Variable(name[1:-1] if name[0] == '<' else f'urn:swrl:var#{name}')
        return (
            self._tokens.literal()
            if self._tokens.at_literal()
            else self._tokens.iri('an individual')
        )

    # --- frames ---

    def axioms(self) -> list[Axiom]:
        """Read frames and rules, ``Class: A SubClassOf: B``."""
        found: list[Axiom] = []
        while self._tokens.next.kind != 'end':
            found += self.frame()
        return found

    def frame(self) -> list[Axiom]:
        """Read one frame, list or rule."""
        word = self._tokens.take().text
        head = word.removesuffix(':')
        if word == head or head not in _HEADS:
            self._tokens.at -= 1
            raise self._tokens.error('a frame such as Class: or Individual:')
        if head in _RULES:
            return [self.rule()]
        if head in _SETS:
            notes = self._notes()
            return [*_noted(notes, _SETS[head](frozenset(self._several(self._tokens.iri))))]
        if head in _LISTS:
            notes = self._notes()
            return [*_noted(notes, self._listed(head))]
        if head not in _FRAMES:
            raise self._tokens.error(f'no {word} here')
        return list(self._entity(_FRAMES[head]))

    def _listed(self, head: str) -> Axiom:
        if head.endswith('Classes'):
            classes = tuple(self._several(self.class_expression))
            return (ax.EquivalentClasses if head[0] == 'E' else ax.DisjointClasses)(classes)
        props = tuple(self._several(self._property))
        data = all(('data_property', prop) in self._kinds for prop in props)
        kind = 'Data' if data else 'Object'
        made: Axiom = getattr(ax, head.replace('Properties', f'{kind}Properties'))(props)
        return made

    def _entity(self, kind: str) -> Iterator[Axiom]:
        subject: Any
        if kind == 'class':
            subject = self.class_expression()
        elif kind == 'object_property':
            subject = self._property()
        else:
            subject = self._tokens.iri()
        if isinstance(subject, str):
            self._kinds.add((kind, subject))
            if not subject.startswith('_:') and not subject.startswith((OWL, XSD, RDFS)):
                yield ax.Declaration(kind, subject)
        while self._tokens.next.kind == 'keyword' and self._tokens.next.text[:-1] not in _HEADS:
            word = self._tokens.take().text[:-1]
            if word == 'Annotations':
                if not isinstance(subject, str):
                    told = f'line {self._tokens.line}: annotations of what has no name are not kept'
                    self.unsupported.append(told)
                found = list(self.annotations(str(subject)))
                yield from found if isinstance(subject, str) else ()
                continue
            sections = getattr(self, f'_{kind}_section')
            yield from sections(word, subject)

    def _no_section(self, word: str) -> OntologyFileError:
        self._tokens.at -= 1
        return self._tokens.error(f'a section of this frame, not {word}:')

    def _class_section(self, word: str, cls: Any) -> Iterator[Axiom]:
        if word == 'HasKey':
            notes = self._notes()
            objects: list[ex.PropertyExpression] = []
            datas: list[ex.PropertyExpression] = []
            while self._tokens.next.kind in ('iri', 'name') or self._tokens.is_next('('):
                key = self._property()
                is_data = ('data_property', key) in self._kinds
                (datas if is_data else objects).append(key)
                self._tokens.accept(',')
            yield from _noted(notes, ax.HasKey(cls, tuple(objects), tuple(map(str, datas))))
        elif word == 'DisjointUnionOf':
            notes = self._notes()
            parts = self._several(self.class_expression)
            yield from _noted(notes, ax.DisjointUnion(cls, tuple(parts)))
        elif word in _OF_CLASSES:
            for notes, other in self._annotated(self.class_expression):
                yield from _noted(notes, _OF_CLASSES[word](cls, other))
        else:
            raise self._no_section(word)

    def _object_property_section(self, word: str, prop: Any) -> Iterator[Axiom]:
        if word == 'Characteristics':
            for notes, token in self._annotated(lambda: self._tokens.take(*_CHARACTERISTICS)):
                yield from _noted(notes, _CHARACTERISTICS[token.text](prop))
        elif word == 'SubPropertyChain':
            notes = self._notes()
            chain = [self._property()]
            while self._tokens.accept('o'):
                chain.append(self._property())
            yield from _noted(notes, ax.SubPropertyChainOf(tuple(chain), prop))
        elif word in ('Domain', 'Range'):
            record = ax.ObjectPropertyDomain if word == 'Domain' else ax.ObjectPropertyRange
            for notes, cls in self._annotated(self.class_expression):
                yield from _noted(notes, record(prop, cls))
        elif word in _PAIRED:
            for notes, other in self._annotated(self._property):
                yield from _noted(notes, _PAIRED[word](prop, other))
        else:
            raise self._no_section(word)

    def _data_property_section(self, word: str, prop: str) -> Iterator[Axiom]:
        if word == 'Characteristics':
            for notes, _ in self._annotated(lambda: self._tokens.take('Functional')):
                yield from _noted(notes, ax.FunctionalDataProperty(prop))
        elif word == 'Domain':
            for notes, cls in self._annotated(self.class_expression):
                yield from _noted(notes, ax.DataPropertyDomain(prop, cls))
        elif word == 'Range':
            for notes, values in self._annotated(self.data_range):
                yield from _noted(notes, ax.DataPropertyRange(prop, values))
        elif word in _OF_VALUES:
            for notes, other in self._annotated(self._tokens.iri):
                yield from _noted(notes, _OF_VALUES[word](prop, other))
        else:
            raise self._no_section(word)

    def _annotation_property_section(self, word: str, prop: str) -> Iterator[Axiom]:
        names = {'SubPropertyOf': 'subPropertyOf', 'Domain': 'domain', 'Range': 'range'}
        if word not in names:
            raise self._no_section(word)
        for notes, other in self._annotated(self._tokens.iri):
            yield from _noted(notes, ax.AnnotationAssertion(RDFS + names[word], prop, other))

    def _datatype_section(self, word: str, datatype: str) -> Iterator[Axiom]:
        if word != 'EquivalentTo':
            raise self._no_section(word)
        for notes, values in self._annotated(self.data_range):
            yield from _noted(notes, ax.DatatypeDefinition(datatype, values))

    def _individual_section(self, word: str, ind: str) -> Iterator[Axiom]:
        if word in ('Types', 'Type'):
            for notes, cls in self._annotated(self.class_expression):
                yield from _noted(notes, ax.ClassAssertion(cls, ind))
        elif word == 'Facts':
            for notes, fact in self._annotated(lambda: self._fact(ind)):
                yield from _noted(notes, fact)
        elif word in ('SameAs', 'DifferentFrom'):
            record = _SETS['SameIndividual' if word == 'SameAs' else 'DifferentIndividuals']
            for notes, other in self._annotated(self._tokens.iri):
                yield from _noted(notes, record(frozenset((ind, other))))
        else:
            raise self._no_section(word)

    def _fact(self, ind: str) -> Axiom:
        negative = self._tokens.accept('not')
        prop = self._property()
        if self._tokens.at_literal():
            data = ax.NegativeDataPropertyAssertion if negative else ax.DataPropertyAssertion
            return data(str(prop), ind, self._tokens.literal())
        other = self._tokens.iri('an individual')
        if isinstance(prop, ex.ObjectInverseOf):
            prop, ind, other = prop.prop, other, ind
        record = ax.NegativeObjectPropertyAssertion if negative else ax.ObjectPropertyAssertion
        return record(prop, ind, other)


def _noted(notes: _Notes, axiom: Axiom) -> Iterator[Axiom]:
    """Yield an axiom, and what is said of it."""
    yield axiom
    if notes:
        yield ax.AxiomAnnotation(axiom, notes)


_OF_CLASSES: dict[str, Callable[[Any, Any], Axiom]] = {
    'SubClassOf': ax.SubClassOf,
    'EquivalentTo': lambda first, second: ax.EquivalentClasses((first, second)),
    'DisjointWith': lambda first, second: ax.DisjointClasses((first, second)),
}
_OF_VALUES: dict[str, Callable[[str, str], Axiom]] = {
    'SubPropertyOf': ax.SubDataPropertyOf,
    'EquivalentTo': lambda first, second: ax.EquivalentDataProperties((first, second)),
    'DisjointWith': lambda first, second: ax.DisjointDataProperties((first, second)),
}
_PAIRED: dict[str, Callable[[Any, Any], Axiom]] = {
    'SubPropertyOf': ax.SubObjectPropertyOf,
    'InverseOf': ax.InverseObjectProperties,
    'EquivalentTo': lambda first, second: ax.EquivalentObjectProperties((first, second)),
    'DisjointWith': lambda first, second: ax.DisjointObjectProperties((first, second)),
}
_HEADER = re.compile(
    r'(?P<space>(?:\s+|\#[^\n]*\n)+)'
    r'|Prefix:\s*(?P<prefix>[\w.-]*):\s*<(?P<base>[^<>\s]*)>'
    r'|Ontology:\s*(?:<(?P<iri>[^<>\s]*)>\s*(?:<(?P<version>[^<>\s]*)>)?)?'
    r'|Import:\s*<(?P<import>[^<>\s]*)>'
)
_DECLARED = re.compile(
    r'(?<!\S)(Class|ObjectProperty|DataProperty|AnnotationProperty|Datatype|Individual):'
    r'\s+(<[^<>\s]*>|[^\s()\[\]{},<>"^@]+)'
)


class ManchesterDocument(Axioms):
    """A document, whose frames are read once it is known what its imports declare."""

    def __init__(self, text: str, iri: str) -> None:
        super().__init__(lambda place: text.count('\n', 0, place) + 1, iri)
        self._body = text
        place = 0
        while (match := _HEADER.match(text, place)) is not None and match.end() > place:
            if match['prefix'] is not None:
                self.prefixes[match['prefix']] = match['base']
            elif match['import'] is not None:
                self.axioms[ax.Import(match['import'])] = None
            elif match['space'] is None:
                self.iri = match['iri'] or ''
                if match['version']:
                    self.version(match['version'])
            place = match.end()
        self._body = re.sub('[^\n]', ' ', text[:place]) + text[place:]

    @property
    def declared(self) -> Iterator[tuple[str, str]]:
        """Pairs (kind, IRI) of what the document declares."""
        for match in _DECLARED.finditer(self._body):
            try:
                name = match[2]
                yield _FRAMES[match[1]], name[1:-1] if name[0] == '<' else self._full(name)
            except ValueError:
                continue

    def read(self, declared: Iterable[tuple[str, str]] = ()) -> None:
        """Read the frames."""
        known = [*declared, *self.declared]
        parser = ManchesterParser(self._body, self._full, known)
        self.axioms.update(dict.fromkeys(parser.header(self.called)))
        self.axioms.update(dict.fromkeys(parser.axioms()))
        self.unsupported += parser.unsupported

    def _full(self, name: str) -> str:
        if name.startswith('_:'):
            return name
        iri = self.named(name if ':' in name else f':{name}')
        if iri is None and ':' not in name:
            iri = (self.iri or self._base).rstrip('#') + '#' + name
        if iri is None:
            raise ValueError(f'the prefix of {name!r} is not declared')
        return iri


# --- writing ---


class ManchesterWriter:
    """Writes axioms.

    Args:
        prefixes: What namespaces are written as; others are written in full.
        bare: Whether names behind the empty prefix are written without its colon.
    """

    def __init__(self, prefixes: Mapping[str, str], *, bare: bool = False) -> None:
        self._bare = bare
        known = {**PREFIXES, **prefixes}
        self.prefixes = {name: base for name, base in known.items() if base}
        self._bases = sorted(self.prefixes.items(), key=lambda item: -len(item[1]))

    def document(self, axioms: Iterable[Axiom], iri: str) -> str:
        """Return a document."""
        lines = [f'Prefix: {name}: <{base}>' for name, base in self.prefixes.items()]
        axioms = list(axioms)
        lines += ['', f'Ontology: <{iri}>']
        lines += [f'Import: <{axiom.iri}>' for axiom in axioms if isinstance(axiom, ax.Import)]
        notes: dict[Axiom, list[ax.AxiomAnnotation]] = {}
        for axiom in axioms:
            if isinstance(axiom, ax.AxiomAnnotation):
                notes.setdefault(axiom.axiom, []).append(axiom)
        left = [a for a in axioms if not isinstance(a, ax.Import | ax.AxiomAnnotation)]
        kinds: dict[str, list[str]] = {}
        for axiom in left:
            if isinstance(axiom, ax.Declaration):
                kinds.setdefault(axiom.iri, []).append(axiom.kind)

        def kind_of(iri: str) -> str:
            return kinds.get(iri, ['individual'])[0]

        frames = []
        for axiom in left:
            frame = self.axiom(axiom, kind_of, notes.get(axiom, ()))
            if isinstance(axiom, ax.AnnotationAssertion) and axiom.subject == iri:
                lines.append(frame[frame.index('Annotations: ') :])
            else:
                frames.append(frame)
        return '\n'.join((*lines, *self._used(left, kinds), *frames)) + '\n'

    def _used(
        self, axioms: Iterable[Axiom], declared: Mapping[str, Iterable[str]]
    ) -> Iterator[str]:
        """Yield the declarations of the properties and datatypes that axioms use undeclared.

        Without, a reader could not tell a data property from an object property.
        """
        used = dict.fromkeys(entity for axiom in axioms for entity in entities_of(axiom))
        for kind, iri in used:
            told = kind in ('object_property', 'data_property', 'datatype')
            if told and kind not in declared.get(iri, ()) and not iri.startswith(_BUILT_IN):
                yield self.axiom(ax.Declaration(kind, iri))

    def name(self, iri: str) -> str:
        """Return a name with its prefix, or in full."""
        if iri.startswith('_:'):
            return iri
        for prefix, base in self._bases:
            if iri.startswith(base) and re.fullmatch(r'[A-Za-z_][\w-]*', iri[len(base) :]):
                local = iri[len(base) :]
                if prefix or not self._bare:
                    return f'{prefix}:{local}'
                if local not in _WORDS:
                    return local
        return f'<{iri}>'

    def literal(self, literal: Literal) -> str:
        """Return a value."""
        text = literal.lexical.replace('\\', '\\\\').replace('"', '\\"')
        if literal.language:
            return f'"{text}"@{literal.language}'
        if literal.datatype == XSD + 'string':
            return f'"{text}"'
        return f'"{text}"^^{self.name(literal.datatype)}'

    def expression(self, part: Any, *, inner: bool = True) -> str:
        """Return a class expression, data range or property; in brackets where it needs them."""
        if isinstance(part, str):
            return self.name(part)
        if isinstance(part, Literal):
            return self.literal(part)
        if isinstance(part, ex.ObjectInverseOf):
            return (
                f'inverse ({self.name(part.prop)})'
                if not inner
                else (f'(inverse ({self.name(part.prop)}))')
            )
        text = self._compound(part)
        alone = isinstance(part, ex.ObjectOneOf | ex.DataOneOf | ex.DatatypeRestriction)
        return f'({text})' if inner and not alone else text

    def _compound(self, part: Any) -> str:
        kind = type(part).__name__
        if kind.endswith(('IntersectionOf', 'UnionOf')):
            word = ' and ' if 'Inter' in kind else ' or '
            return word.join(map(self.expression, part.operands))
        if kind.endswith('ComplementOf'):
            return f'not {self.expression(part.operand)}'
        if kind.endswith('OneOf'):
            members = part.literals if kind[0] == 'D' else part.individuals
            return f'{{{", ".join(map(self.expression, members))}}}'
        if isinstance(part, ex.DatatypeRestriction):
            facets = ', '.join(
                f'{_SIGNS.get(name, local_name(name))} {self.literal(bound)}'
                for name, bound in part.facets
            )
            return f'{self.name(part.datatype)}[{facets}]'
        prop = self.expression(part.prop)
        if isinstance(part, ex.ObjectHasSelf):
            return f'{prop} Self'
        if kind.endswith('HasValue'):
            held = part.literal if kind[0] == 'D' else part.individual
            return f'{prop} value {self.expression(held)}'
        filler = self.expression(part.range if kind[0] == 'D' else part.filler)
        if kind.endswith('Cardinality'):
            word = next(w for w, records in _COUNTS.items() if type(part) in records)
            return f'{prop} {word} {part.n} {filler}'
        return f'{prop} {"some" if "Some" in kind else "only"} {filler}'

    def axiom(
        self,
        axiom: Axiom,
        kind_of: Callable[[str], str] = lambda _: 'individual',
        notes: Iterable[ax.AxiomAnnotation] = (),
    ) -> str:
        """Return an axiom as a frame of its own.

        Args:
            axiom: Any but an import.
            kind_of: What kind of entity a name is that is annotated.
            notes: What is said of the axiom.

        Raises:
            OntologyFileError: It is a declaration, of which nothing can be said.
        """
        said = self._said(tuple(pair for note in notes for pair in note.annotations))
        if said and isinstance(axiom, ax.Declaration):
            raise OntologyFileError(
                f'Manchester syntax cannot annotate the declaration of {self.name(axiom.iri)};'
                ' save it as RDF/XML or N-Triples (.nt)'
            )
        kind = type(axiom).__name__
        say = self.expression
        plain = kind.replace('Object', '').replace('Data', '')
        data = 'DataProp' in kind
        frame = 'DataProperty' if data else 'ObjectProperty'
        if isinstance(axiom, ax.Declaration):
            word = next(word for word, one in _FRAMES.items() if one == axiom.kind)
            return f'{word}: {self.name(axiom.iri)}'
        if isinstance(axiom, ax.AnnotationAssertion):
            found = kind_of(axiom.subject)
            word = next(word for word, one in _FRAMES.items() if one == found)
            note = self._note(axiom.prop, axiom.value)
            return f'{word}: {self.name(axiom.subject)} Annotations: {said}{note}'
        if isinstance(axiom, ax.Rule):
            body, head = (', '.join(map(self._atom, atoms)) for atoms in (axiom.body, axiom.head))
            return f'Rule: {self._said(axiom.annotations)}{body} -> {head}'
        if isinstance(axiom, ax.SubClassOf):
            return f'Class: {say(axiom.sub)} SubClassOf: {said}{say(axiom.sup)}'
        if isinstance(axiom, ax.EquivalentClasses | ax.DisjointClasses):
            return f'{kind}: {said}{", ".join(map(say, axiom.classes))}'
        if isinstance(axiom, ax.DisjointUnion):
            listed = ', '.join(map(say, axiom.classes))
            return f'Class: {say(axiom.cls)} DisjointUnionOf: {said}{listed}'
        if isinstance(axiom, ax.HasKey):
            keys = ', '.join(map(say, (*axiom.object_props, *axiom.data_props)))
            return f'Class: {say(axiom.cls)} HasKey: {said}{keys}'
        if isinstance(axiom, ax.SameIndividual | ax.DifferentIndividuals):
            return f'{kind}: {said}{", ".join(map(self.name, sorted(axiom.individuals)))}'
        if isinstance(axiom, ax.ClassAssertion):
            return f'Individual: {self.name(axiom.individual)} Types: {said}{say(axiom.cls)}'
        if plain in ('PropertyAssertion', 'NegativePropertyAssertion'):
            held: Any = getattr(axiom, 'literal', None) or getattr(axiom, 'object', '')
            no = 'not ' if plain[0] == 'N' else ''
            subject, prop = axiom.subject, axiom.prop  # type: ignore[attr-defined]
            return f'Individual: {self.name(subject)} Facts: {said}{no}{say(prop)} {say(held)}'
        if isinstance(axiom, ax.SubPropertyChainOf):
            chain = ' o '.join(map(say, axiom.chain))
            return f'ObjectProperty: {say(axiom.sup, inner=False)} SubPropertyChain: {said}{chain}'
        if isinstance(axiom, ax.DatatypeDefinition):
            return f'Datatype: {self.name(axiom.datatype)} EquivalentTo: {said}{say(axiom.range)}'
        if plain in ('EquivalentProperties', 'DisjointProperties'):
            return f'{plain}: {said}{", ".join(map(say, axiom.props))}'  # type: ignore[attr-defined]
        if isinstance(axiom, ax.InverseObjectProperties):
            first, second = say(axiom.first, inner=False), say(axiom.second)
            return f'ObjectProperty: {first} InverseOf: {said}{second}'
        if plain == 'SubPropertyOf':
            sub, sup = axiom.sub, axiom.sup  # type: ignore[attr-defined]
            return f'{frame}: {say(sub, inner=False)} SubPropertyOf: {said}{say(sup)}'
        prop = say(axiom.prop, inner=False)  # type: ignore[attr-defined]
        if plain == 'PropertyDomain':
            return f'{frame}: {prop} Domain: {said}{say(axiom.domain)}'  # type: ignore[attr-defined]
        if plain == 'PropertyRange':
            return f'{frame}: {prop} Range: {said}{say(axiom.range)}'  # type: ignore[attr-defined]
        return f'{frame}: {prop} Characteristics: {said}{plain.removesuffix("Property")}'

    def _said(self, notes: _Notes) -> str:
        """Return annotations as they stand in front of what they annotate; '' without any."""
        listed = ', '.join(self._note(*note) for note in notes)
        return f'Annotations: {listed} ' if notes else ''

    def _note(self, prop: str, value: str | Literal) -> str:
        return f'{self.name(prop)} {self.expression(value)}'

    def _atom(self, atom: Any) -> str:
        if isinstance(atom, ex.SameIndividualAtom | ex.DifferentIndividualsAtom):
            word = 'sameAs' if isinstance(atom, ex.SameIndividualAtom) else 'differentFrom'
            return f'{word}({self._argument(atom.first)}, {self._argument(atom.second)})'
        if isinstance(atom, ex.BuiltinAtom):
            arguments = ', '.join(map(self._argument, atom.arguments))
            return f'{self.name(atom.builtin)}({arguments})'
        if isinstance(atom, ex.ClassAtom | ex.DataRangeAtom):
            of = atom.cls if isinstance(atom, ex.ClassAtom) else atom.range
            return f'{self.expression(of)}({self._argument(atom.argument)})'
        first, second = map(self._argument, (atom.first, atom.second))
        return f'{self.expression(atom.prop)}({first}, {second})'

    def _argument(self, argument: Any) -> str:
        if isinstance(argument, ex.Variable):
            name = argument.name.removeprefix('urn:swrl:var#')
            return f'?{name}' if re.fullmatch(r'\w+', name) else f'?<{argument.name}>'
        return self.expression(argument)
