"""The process that runs SPARQL queries, so that one that takes too long can be killed.

It reads requests from standard input and writes answers to standard output, each a line of JSON;
the graph follows a request as N-Triples, when the request says how many bytes of it there are.

Oxigraph keeps numbers and times by value and forgets how they were written: ``"7"^^xsd:long`` comes
back as ``"7"^^xsd:integer``. Answers have to show what was asserted, so the original forms are kept
beside the store. Values that a query computes (``AS ?n``) are left as they are.
"""

from __future__ import annotations

import json
import re
import resource
import signal
import sys
from typing import Any, BinaryIO

import pyoxigraph

Originals = dict[Any, Any]
"""Literals as they were written, by the form in which the store gives them."""
_COMPUTED = re.compile(r'\bAS\s+[?$](\w+)', re.IGNORECASE)
_XSD = 'http://www.w3.org/2001/XMLSchema#'
MOST_SHOWN = 160
"""Characters of the engine's own words about a query."""
NO_FURTHER_FILES = 3
"""Standard input, output and error; a query with SERVICE gets no socket."""


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests until the end of input."""
    store, originals = pyoxigraph.Store(), Originals()
    for line in requests:
        request = json.loads(line)
        size = request['graph']
        if size is not None:
            store, originals = _load(requests.read(size))
        # The kernel ends this process if the one that asked is not there to do it.
        signal.setitimer(signal.ITIMER_REAL, request['seconds'])
        answer = _answer(store, originals, request['query'], request['rows'])
        signal.setitimer(signal.ITIMER_REAL, 0)
        answers.write(json.dumps(answer).encode() + b'\n')
        answers.flush()


def _load(graph: bytes) -> tuple[pyoxigraph.Store, Originals]:
    store, written = pyoxigraph.Store(), pyoxigraph.Store()
    quads = list(pyoxigraph.parse(graph, format=pyoxigraph.RdfFormat.N_TRIPLES))
    store.bulk_extend(quads)
    literals = list({quad.object for quad in quads if _may_be_rewritten(quad.object)})
    mark = pyoxigraph.NamedNode('urn:mark')
    written.bulk_extend(
        pyoxigraph.Quad(pyoxigraph.NamedNode(f'urn:number:{number}'), mark, literal)
        for number, literal in enumerate(literals)
    )
    originals = Originals()
    for quad in written:
        original = literals[int(quad.subject.value.rpartition(':')[2])]
        if original != quad.object:
            originals[quad.object] = original
    return store, originals


def _may_be_rewritten(term: Any) -> bool:
    return (
        isinstance(term, pyoxigraph.Literal)
        and not term.language
        and term.datatype.value.startswith(_XSD)
        and term.datatype.value != _XSD + 'string'
    )


def _answer(store: pyoxigraph.Store, originals: Originals, query: str, most: int) -> dict[str, Any]:
    computed = set(_COMPUTED.findall(query))
    try:
        found = store.query(query)
        if not isinstance(found, pyoxigraph.QuerySolutions):
            return {'error': 'expected a SELECT query'}
        names = [variable.value for variable in found.variables]
        rows: list[list[list[str]]] = []
        for solution in found:
            if len(rows) == most:
                return {'error': f'more than {most} rows'}
            bound = zip(names, solution, strict=True)
            rows.append(
                [
                    [name, *_term(term if name in computed else originals.get(term, term))]
                    for name, term in bound
                    if term is not None
                ]
            )
    except SyntaxError as error:
        return {'error': f'not valid SPARQL: {str(error)[:MOST_SHOWN]}'}
    except (ValueError, RuntimeError, OSError) as error:
        return {'error': f'cannot be run: {error}'}
    return {'rows': rows}


def _term(term: Any) -> tuple[str, str, str]:
    if isinstance(term, pyoxigraph.Literal):
        return term.value, term.datatype.value, term.language or ''
    if isinstance(term, pyoxigraph.BlankNode):
        return f'_:{term.value}', '', ''
    if isinstance(term, pyoxigraph.NamedNode):
        return term.value, '', ''
    return str(term), '', ''


def main() -> None:
    """Limit this process, then serve."""
    memory = int(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_NOFILE, (NO_FURTHER_FILES, NO_FURTHER_FILES))
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    serve(sys.stdin.buffer, sys.stdout.buffer)


if __name__ == '__main__':
    main()
