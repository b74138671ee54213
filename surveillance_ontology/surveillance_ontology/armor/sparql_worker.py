"""The process that runs SPARQL queries, so that one that takes too long can be killed.

It reads requests from standard input and writes answers to standard output, each a line of JSON. A
request has a graph, which follows it as N-Triples and is kept for the queries that come next, or a
query.
"""

from __future__ import annotations

import json
import resource
import signal
import sys
from typing import Any, BinaryIO

import pyoxigraph

from surveillance_ontology.armor.sparql import OUT_OF_MEMORY
from surveillance_ontology.armor.written_forms import WrittenForms

MOST_SHOWN = 160
"""Characters of the engine's own words about a query."""
NO_FURTHER_FILES = 3
"""Standard input, output and error; a query with SERVICE gets no socket."""


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests until the end of input."""
    store, forms = _load(b'')
    for line in requests:
        request = json.loads(line)
        if 'graph' in request:
            store, forms = _load(requests.read(request['graph']))
            answer: dict[str, Any] = {}
        else:
            # The kernel ends this process if the one that asked is not there to do it.
            signal.setitimer(signal.ITIMER_REAL, request['seconds'])
            answer = _answer(store, forms, request['query'], request['rows'])
            signal.setitimer(signal.ITIMER_REAL, 0)
        answers.write(json.dumps(answer).encode() + b'\n')
        answers.flush()


def _load(graph: bytes) -> tuple[pyoxigraph.Store, WrittenForms]:
    store = pyoxigraph.Store()
    quads = list(pyoxigraph.parse(graph, format=pyoxigraph.RdfFormat.N_TRIPLES))
    store.bulk_extend(quads)
    return store, WrittenForms(quads)


def _answer(store: pyoxigraph.Store, forms: WrittenForms, query: str, most: int) -> dict[str, Any]:
    try:
        found = store.query(query)
        if not isinstance(found, pyoxigraph.QuerySolutions):
            return {'error': 'expected a SELECT query'}
        names = [variable.value for variable in found.variables]
        reader = forms.reader(query)
        rows: list[list[list[str]]] = []
        for solution in found:
            if len(rows) == most:
                return {'error': f'more than {most} rows'}
            bound = zip(names, solution, strict=True)
            row = {name: term for name, term in bound if term is not None}
            rows.append([[name, *_term(reader.written(name, row))] for name in row])
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
    try:
        serve(sys.stdin.buffer, sys.stdout.buffer)
    except MemoryError:
        sys.exit(OUT_OF_MEMORY)


if __name__ == '__main__':
    main()
