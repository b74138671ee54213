"""The process that runs SPARQL queries, so that one that takes too long ends with it.

It reads requests from standard input and writes answers to standard output, each a line of JSON. A
request is a query, or has a graph, or triples that go and come in the graph that is there: they
follow it as N-Triples. Each has the seconds after which the kernel ends this process.

Oxigraph keeps numbers and times by value and forgets how they were written: ``"7"^^xsd:long`` comes
back as ``"7"^^xsd:integer``. Answers have to show what was asserted. Where a value is written in
one way only, that is it. Where it is written in several ways, the triple that it was found in
decides, as far as the query and the row tell which that was.
"""

from __future__ import annotations

import json
import re
import resource
import signal
import sys
from collections.abc import Iterable, Mapping
from typing import Any, BinaryIO

import pyoxigraph

MOST_SHOWN = 160
"""Characters of the engine's own words about a query."""
NO_FURTHER_FILES = 3
"""Standard input, output and error: a query that reached for a file or a machine would get none."""
MOST_CHARACTERS = 64 * 1024 * 1024
"""In one answer; the server holds it in memory."""
_NO_KEYWORDS = re.compile(
    r"""("{3}|'{3})(?:[^\\]|\\.)*?\1|"[^"\\]*+(?:\\.[^"\\]*+)*+"|'[^'\\]*+(?:\\.[^'\\]*+)*+'"""
    r"""|<[^<>"{}|^`\\\s]*>|#[^\r\n]*|[?$]\w+|(?<![\w.-])[\w.-]*+:[\w.:-]*""",
    re.DOTALL,
)
"""Strings, IRIs, comments, variables and prefixed names (SPARQL 1.1, section 19.8)."""
_OUTSIDE = {'SERVICE': 'asks another machine', 'FROM': 'names another graph'}
"""Keywords of what a query may not do; some would give no rows and say nothing."""


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests until the end of input."""
    store, forms = pyoxigraph.Store(), WrittenForms()
    for line in requests:
        request = json.loads(line)
        signal.setitimer(signal.ITIMER_REAL, request['seconds'])
        if 'whole' in request:
            if request['whole']:
                store, forms = pyoxigraph.Store(), WrittenForms()
            removed = requests.read(request['removed'])
            added = requests.read(request['added'])
            answer: dict[str, Any] = {}
            try:
                for quad in _quads(removed):
                    store.remove(quad)
                store.bulk_load(added, format=pyoxigraph.RdfFormat.N_TRIPLES, lenient=True)
                forms.change(_rewritten(added), _rewritten(removed))
            except SyntaxError as error:
                answer = {'error': f'the ontology is no graph: {str(error)[:MOST_SHOWN]}'}
        else:
            answer = _answer(store, forms, request['query'], request['rows'])
        signal.setitimer(signal.ITIMER_REAL, 0)
        answers.write(json.dumps(answer).encode() + b'\n')
        answers.flush()


def _quads(triples: bytes) -> list[Any]:
    # Names that are no IRIs are read from documents, too.
    return list(pyoxigraph.parse(triples, format=pyoxigraph.RdfFormat.N_TRIPLES, lenient=True))


def _rewritten(triples: bytes) -> list[Any]:
    """Return the quads whose values a store may give back in another form."""
    lines = triples.splitlines(keepends=True)
    return _quads(b''.join(line for line in lines if _VALUE in line and not line.endswith(_PLAIN)))


def _answer(store: pyoxigraph.Store, forms: WrittenForms, query: str, most: int) -> dict[str, Any]:
    words = _NO_KEYWORDS.sub(' ', query).upper()
    for keyword, what in _OUTSIDE.items():
        if re.search(rf'\b{keyword}\b', words):
            return {'error': f'{keyword} {what}; expected a query of this ontology alone'}
    characters = 0
    try:
        found = store.query(query)
        if not isinstance(found, pyoxigraph.QuerySolutions):
            return {'error': 'expected a SELECT query'}
        names = [variable.value for variable in found.variables]
        reader = forms.reader(query)
        rows: list[list[tuple[str, str]]] = []
        for solution in found:
            if len(rows) == most:
                return {'error': f'more than {most} rows'}
            bound = zip(names, solution, strict=True)
            row = {name: term for name, term in bound if term is not None}
            rows.append([(name, _text(reader.written(name, row))) for name in row])
            characters += sum(len(text) for bound in rows[-1] for text in bound)
            if characters > MOST_CHARACTERS:
                return {'error': f'more than {MOST_CHARACTERS} characters'}
    except SyntaxError as error:
        return {'error': f'not valid SPARQL: {str(error)[:MOST_SHOWN]}'}
    except (ValueError, RuntimeError, OSError) as error:
        return {'error': f'cannot be run: {error}'}
    return {'rows': rows}


def _text(term: Any) -> str:
    if isinstance(term, pyoxigraph.Literal):
        if term.language:
            return f'{term.value}@{term.language}'
        datatype = term.datatype.value
        return term.value if datatype == _XSD + 'string' else f'{term.value}^^{datatype}'
    if isinstance(term, pyoxigraph.BlankNode):
        return f'_:{term.value}'
    return term.value if isinstance(term, pyoxigraph.NamedNode) else str(term)


_XSD = 'http://www.w3.org/2001/XMLSchema#'
_VALUE = f'"^^<{_XSD}'.encode()
_PLAIN = f'"^^<{_XSD}string> .\n'.encode()
_INTEGER = pyoxigraph.NamedNode(_XSD + 'integer')
_WHOLE = {_XSD + name for name in ('integer', 'long', 'int', 'short', 'byte')}
"""Datatypes whose values are all kept as integers, where they are written as those are."""
_CANONICAL = re.compile('0|-?[1-9][0-9]{0,17}')
_COMPUTED = re.compile(r'\bAS\s+[?$](\w+)', re.IGNORECASE)
_PREFIX = re.compile(r'\bPREFIX\s+([\w.-]*):\s*<([^<>]*)>', re.IGNORECASE)
_NAME = re.compile(r'<([^<>\s]*+)>|(?<![\w.-])([\w.-]*+):([\w.-]*\w)')
_BEFORE = r'(?<!\S)(\S++)\s+[?$]{}\b'
_VARIABLE = re.compile(r'[?$](\w+)')

_Places = dict[tuple[str, str], None]
"""Subjects and predicates of the triples in which a form stands."""
_Forms = dict[Any, dict[Any, _Places]]
"""For each form in which the store keeps a literal, the ways in which it was written."""


class WrittenForms:
    """The written forms of the literals of one graph."""

    def __init__(self) -> None:
        self._forms: _Forms = {}

    def change(self, added: Iterable[Any], removed: Iterable[Any] = ()) -> None:
        """Take in quads that came and went whose values may be rewritten, as they were parsed."""
        gone, come = list(removed), list(added)
        kept = _kept_forms({quad.object for quad in (*gone, *come)})
        for quad in gone:
            written = self._forms.get(kept[quad.object], {})
            places = written.get(quad.object, {})
            places.pop((_iri(quad.subject), quad.predicate.value), None)
            if not places:
                written.pop(quad.object, None)
            if not written:
                self._forms.pop(kept[quad.object], None)
        for quad in come:
            written = self._forms.setdefault(kept[quad.object], {})
            places = written.setdefault(quad.object, {})
            places[_iri(quad.subject), quad.predicate.value] = None

    def reader(self, query: str) -> Reader:
        """Return what reads the rows of one query."""
        return Reader(self._forms, query)


class Reader:
    """Gives back the written forms in the rows of one query.

    Values that the query computes (``AS ?n``) are left as they are.
    """

    def __init__(self, forms: _Forms, query: str) -> None:
        self._forms = forms
        self._query = query
        self._computed = set(_COMPUTED.findall(query))
        self._prefixes = dict(_PREFIX.findall(query))
        self._mentioned = set(self._names(query))
        self._before: dict[str, list[str]] = {}

    def written(self, variable: str, row: Mapping[str, Any]) -> Any:
        """Return a variable's value in a row as it was written."""
        term = row[variable]
        if variable in self._computed or not isinstance(term, pyoxigraph.Literal):
            return term
        several = self._forms.get(term)
        if several is None:
            return term
        if len(several) == 1:
            return next(iter(several))
        predicates = self._predicates(variable, row)
        near = self._mentioned | {_iri(value) for value in row.values()}

        def likeness(form: Any) -> tuple[bool, bool]:
            return max((p in predicates, subject in near) for subject, p in several[form])

        return max(sorted(several, key=str), key=likeness)

    def _predicates(self, variable: str, row: Mapping[str, Any]) -> set[str]:
        """Return the properties whose value the variable may be."""
        before = self._before.get(variable)
        if before is None:
            pattern = _BEFORE.format(re.escape(variable))
            before = self._before[variable] = re.findall(pattern, self._query)
        bound = (row.get(name) for words in before for name in _VARIABLE.findall(words))
        named = {name for words in before for name in self._names(words)}
        return named | {_iri(term) for term in bound if term is not None}

    def _names(self, text: str) -> Iterable[str]:
        for iri, prefix, local in _NAME.findall(text):
            yield iri or self._prefixes.get(prefix, prefix + ':') + local


def _kept_forms(literals: Iterable[Any]) -> dict[Any, Any]:
    """Return for each literal the form in which a store gives it back."""
    found: dict[Any, Any] = {}
    others: list[Any] = []
    for literal in literals:
        datatype = literal.datatype.value
        if datatype in _WHOLE and _CANONICAL.fullmatch(literal.value):
            found[literal] = pyoxigraph.Literal(literal.value, datatype=_INTEGER)
        else:
            others.append(literal)
    store, mark = pyoxigraph.Store(), pyoxigraph.NamedNode('urn:mark')
    store.bulk_extend(
        pyoxigraph.Quad(pyoxigraph.NamedNode(f'urn:number:{number}'), mark, literal)
        for number, literal in enumerate(others)
    )
    for quad in store:
        found[others[int(quad.subject.value.rpartition(':')[2])]] = quad.object
    return found


def _iri(term: Any) -> str:
    return term.value if isinstance(term, pyoxigraph.NamedNode) else ''


def main() -> None:
    """Limit this process, then serve.

    Its arguments are the bytes of memory that it may use, and its exit code where it needs more.
    """
    memory, out_of_memory = map(int, sys.argv[1:])
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_NOFILE, (NO_FURTHER_FILES, NO_FURTHER_FILES))
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    try:
        serve(sys.stdin.buffer, sys.stdout.buffer)
    except MemoryError:
        sys.exit(out_of_memory)


if __name__ == '__main__':
    main()
