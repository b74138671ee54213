"""The table of directives: what each is called, what it takes, what it does.

One entry drives everything: dispatch, reading of arguments, error messages and the documentation.
Entries are made with the decorators `manipulation`, `query` and `utility` in the modules of the
same names. A new command is one decorated function.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum
from functools import cached_property, lru_cache
from typing import Any, TypeVar

from armor_service.protocol import DirectiveError, DirectiveRequest, ExitCode
from armor_service.rendering import (
    TYPES,
    parse_entity,
    parse_literal,
    shown,
    unsupported_type,
)
from owl_reasoner.owl.vocabulary import NOTHING, OWL, RDF, RDFS, THING, XSD
from strict_files.suggestions import nearest

MAX_CARDINALITY = 2**31 - 1
Run = TypeVar('Run', bound=Callable[..., Any])


class Kind(Enum):
    """What a directive may touch."""

    MANIPULATION = 'manipulation'
    """Changes the ontology: subject to mounting, buffering and the journal."""
    CONTROL = 'control'
    """Applies what waits: as a manipulation, but it adds nothing."""
    QUERY = 'query'
    UTILITY = 'utility'

    @property
    def may_reason(self) -> bool:
        """Whether such a directive can bring the derived facts up to date."""
        return self in (Kind.MANIPULATION, Kind.CONTROL)


class Read(StrEnum):
    """How an argument is read."""

    INDIVIDUAL = 'individual'
    CLASS = 'class'
    OBJECT_PROPERTY = 'object property'
    DATA_PROPERTY = 'data property'
    TYPE = 'type'
    """A word of `rendering.TYPES`; the values behind it are read by it, itself it is not passed."""
    VALUE = 'value'
    STORED = 'stored value'
    """As a value; one that an answer showed is taken whatever it is, to be retracted."""
    NUMBER = 'number'
    FLAG = 'flag'
    TEXT = 'text'


ENTITY_KINDS = {
    Read.INDIVIDUAL: 'individual',
    Read.CLASS: 'class',
    Read.OBJECT_PROPERTY: 'object_property',
    Read.DATA_PROPERTY: 'data_property',
}


_RESERVED = (OWL, RDF, RDFS, XSD)
_BUILT_IN = {
    Read.CLASS: (THING, NOTHING),
    Read.OBJECT_PROPERTY: (OWL + 'topObjectProperty', OWL + 'bottomObjectProperty'),
    Read.DATA_PROPERTY: (OWL + 'topDataProperty', OWL + 'bottomDataProperty'),
}


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of a directive.

    Attributes:
        name: Its name in messages and documentation.
        read: How it is read.
        default: What a missing argument stands for; None: it must be given.
    """

    name: str
    read: Read
    default: str | None = None


@dataclass(frozen=True)
class Directive:
    """One row of the table.

    Attributes:
        command: For example ``QUERY``.
        primary: For example ``SPARQL``, or empty.
        secondary: For example ``FORMATTED``, or empty.
        kind: What it may touch.
        arguments: What it takes; further arguments are ignored, as ARMOR does.
        run: What it does; see the decorators.
        summary: One sentence or two for the documentation.
        differs: How and why it differs from ARMOR 2.2, for the documentation.
        rest: The last argument may be repeated, at least this many times; 0: not repeated.
        most: How many arguments it takes at most; 0: as many as the service allows.
        slow: It may take long and must not run where other directives wait.
        gathers: It takes the longer the larger the ontology is.
        schema: It changes classes or properties, after which reasoning takes longer.
        native: It stands in ARMOR 2.2 too.
        type_error_succeeds: An unsupported type is answered with success, as ARMOR does.
        verb: How ARMOR words what did not happen then.
    """

    command: str
    primary: str
    secondary: str
    kind: Kind
    arguments: tuple[Argument, ...]
    run: Callable[..., Any]
    summary: str
    differs: str = ''
    rest: int = 0
    most: int = 0
    slow: bool = False
    gathers: bool = False
    schema: bool = False
    native: bool = True
    type_error_succeeds: bool = True
    verb: str = ''

    @property
    def words(self) -> str:
        """Command and specifications, one blank between."""
        return ' '.join(word for word in (self.command, self.primary, self.secondary) if word)

    @cached_property
    def required(self) -> int:
        """How many arguments must be given."""
        given = [argument for argument in self.arguments if argument.default is None]
        return len(given) + max(self.rest - 1, 0)

    @property
    def signature(self) -> str:
        """The arguments' names for messages and documentation; optional ones in brackets."""
        names = [a.name if a.default is None else f'[{a.name}]' for a in self.arguments]
        return ', '.join(names) + (', ...' if self.rest else '')

    def read(self, args: Sequence[str], base: str, *, narrow_doubles: bool = False) -> list[Any]:
        """Read the arguments of a request.

        Args:
            args: As they came.
            base: IRI of the ontology, for local names.
            narrow_doubles: Store DOUBLE as xsd:float.

        Returns:
            One value for each argument except the types; defaults filled in.

        Raises:
            DirectiveError: Too few, or one that cannot be read; names the argument.
        """
        count = len(args)
        if count < self.required:
            wanted = f'{"at least " if self.rest else ""}{self.required}'
            raise DirectiveError(
                f'{self.words}: expected {wanted} argument{"s" if self.required != 1 else ""} '
                f'({self.signature}), got {count}'
            )
        if 0 < self.most < count:
            raise DirectiveError(f'{self.words}: {count} arguments, at most {self.most}')
        values: list[Any] = []
        type_word = ''
        try:
            for argument, text in self._paired(args):
                read = argument.read
                if read in ENTITY_KINDS:
                    values.append(self._entity(read, text, base))
                elif read is Read.TYPE:
                    type_word = self._type(text, args)
                elif read in (Read.VALUE, Read.STORED):
                    stored = read is Read.STORED
                    values.append(
                        parse_literal(type_word, text, narrow_doubles=narrow_doubles, stored=stored)
                    )
                else:
                    values.append(_OTHERS[read](text))
        except ValueError as error:
            raise DirectiveError(f'{self.words}: argument {argument.name} {error}') from None
        return values

    def _paired(self, args: Sequence[str]) -> Iterator[tuple[Argument, str]]:
        """Yield each argument with its text: defaults filled in, the last one as often as given."""
        yield from zip(self.arguments, args, strict=False)
        for argument in self.arguments[len(args) :]:
            yield argument, argument.default or ''
        if self.rest:
            for text in args[len(self.arguments) :]:
                yield self.arguments[-1], text

    def _entity(self, read: Read, text: str, base: str) -> str:
        iri = parse_entity(text, base)
        if iri.startswith('_:') and (self.kind is not Kind.QUERY or read is not Read.INDIVIDUAL):
            raise ValueError(f'{shown(text)} is an individual without a name: only queries take it')
        if not iri.startswith(_RESERVED) or iri in _BUILT_IN.get(read, ()):
            return iri
        # It may be asked about and retracted: a document may hold anything.
        if self.kind is Kind.MANIPULATION and self.command != 'REMOVE':
            raise ValueError(f'{shown(text)} is a word of OWL itself, expected another name')
        return iri

    def _type(self, text: str, args: Sequence[str]) -> str:
        word = text.upper()
        if word not in TYPES:
            raise unsupported_type(
                text, args[0], self.verb, args[1], success=self.type_error_succeeds
            )
        return word


def _number(text: str) -> int:
    if not text.isascii() or not text.isdigit() or len(text) > 10 or int(text) > MAX_CARDINALITY:
        raise ValueError(f'{shown(text)} is not a number, expected 0 to {MAX_CARDINALITY}')
    return int(text)


def _flag(text: str) -> bool:
    return text.lower() == 'true'


_OTHERS: dict[Read, Callable[[str], Any]] = {
    Read.NUMBER: _number,
    Read.FLAG: _flag,
    Read.TEXT: str,
}
TABLE: dict[tuple[str, str, str], Directive] = {}
"""Every directive under its capital words; filled by the modules `manipulations`, `queries`, ..."""


def look_up(request: DirectiveRequest) -> Directive:
    """Find the directive that a request names.

    Raises:
        DirectiveError: 202 without a command, 205 when there is no such directive.
    """
    directive = TABLE.get((request.command, request.primary, request.secondary))
    if directive is None:
        key = (request.command.upper(), request.primary.upper(), request.secondary.upper())
        directive = TABLE.get(key)
    if directive is None:
        if not request.command:
            raise DirectiveError('Invalid request. No command specified.', ExitCode.NO_COMMAND)
        raise DirectiveError(
            'Malformed command. No Command/Specs combination match found. '
            f'Please check your service requests and retry. Got {_echo(request)}, '
            f'expected {_expected(*(word[:40].upper() for word in _words(request)))}.'
        )
    return directive


@lru_cache(maxsize=256)
def _expected(command: str, primary: str, secondary: str) -> str:
    """Return the nearest directive of the same command, or the nearest command."""
    commands = dict.fromkeys(known for known, _, _ in TABLE)
    if command not in commands:
        return nearest(command, commands)
    alike = [directive.words for key, directive in TABLE.items() if key[0] == command]
    return nearest(' '.join((command, primary, secondary)), alike)


def _words(request: DirectiveRequest) -> tuple[str, str, str]:
    return request.command, request.primary, request.secondary


def _echo(request: DirectiveRequest) -> str:
    return ' '.join(shown(word, 40) for word in _words(request))


def _enter(
    kind: Kind, words: str, arguments: Sequence[Argument], **properties: Any
) -> Callable[[Run], Run]:
    def enter(run: Run, /) -> Run:
        for spelling in words.split('|'):
            command, primary, secondary, *_ = (*spelling.split(), '', '')
            directive = Directive(
                command, primary, secondary, kind, tuple(arguments), run, **properties
            )
            key = (command, primary, secondary)
            if key in TABLE:
                raise ValueError(f'{directive.words} stands twice in the table')
            TABLE[key] = directive
        return run

    return enter


def manipulation(words: str, *arguments: Argument, **properties: Any) -> Callable[[Run], Run]:
    """Enter a manipulation: ``run(reference, *values) -> list of changes``.

    Args:
        words: Command and specifications; other spellings of the same behind ``|``.
        arguments: What it takes.
        properties: Further fields of `Directive`.
    """
    return _enter(Kind.MANIPULATION, words, arguments, **properties)


def query(words: str, *arguments: Argument, **properties: Any) -> Callable[[Run], Run]:
    """Enter a query: ``run(reference, *values) -> response``; see `manipulation`.

    ``is_consistent`` is filled in afterwards. A slow query is run without the reference's lock,
    which it takes itself for as short as it can: ``run(workspace, reference, *values)``.
    """
    return _enter(Kind.QUERY, words, arguments, **properties)


def control(words: str, *arguments: Argument, **properties: Any) -> Callable[[Run], Run]:
    """Enter APPLY or REASON: ``run(reference, *values) -> remark``; see `manipulation`."""
    return _enter(Kind.CONTROL, words, arguments, **properties)


def utility(words: str, *arguments: Argument, **properties: Any) -> Callable[[Run], Run]:
    """Enter a utility: ``run(workspace, request, *values) -> response``; see `manipulation`."""
    return _enter(Kind.UTILITY, words, arguments, **properties)


IND = Argument('individual', Read.INDIVIDUAL)
CLS = Argument('class', Read.CLASS)
OBJ = Argument('property', Read.OBJECT_PROPERTY)
DAT = Argument('property', Read.DATA_PROPERTY)
TYPE = Argument('type', Read.TYPE)
VALUE = Argument('value', Read.VALUE)
NEW = Argument('new value', Read.VALUE)
OLD = Argument('old value', Read.STORED)
GONE = Argument('value', Read.STORED)


def text(name: str, default: str | None = None) -> Argument:
    """Return an argument that is passed as it came."""
    return Argument(name, Read.TEXT, default)


def flag(name: str, default: str | None = None) -> Argument:
    """Return an argument that is on for ``true`` in any case and off for anything else."""
    return Argument(name, Read.FLAG, default)
