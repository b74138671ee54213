"""The process that runs queries, asked in this process: line by line as the server does."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from typing import Any

import pytest

from armor_service import sparql_worker
from armor_service.sparql_worker import serve

X = 'http://x.org/#'
LONG = 'http://www.w3.org/2001/XMLSchema#long'


class Asked:
    """Requests, written one after another and answered at once."""

    def __init__(self) -> None:
        self.requests = io.BytesIO()

    def graph(self, added: str, removed: str = '', *, whole: bool = False) -> Asked:
        gone, come = removed.encode(), added.encode()
        head = {'seconds': 60, 'whole': whole, 'removed': len(gone), 'added': len(come)}
        self.requests.write(json.dumps(head).encode() + b'\n' + gone + come)
        return self

    def query(self, text: str, rows: int = 100) -> Asked:
        request = {'seconds': 60, 'query': text, 'rows': rows}
        self.requests.write(json.dumps(request).encode() + b'\n')
        return self

    def answers(self) -> list[dict[str, Any]]:
        self.requests.seek(0)
        answers = io.BytesIO()
        serve(self.requests, answers)
        return [json.loads(line) for line in answers.getvalue().splitlines()]


def fact(subject: str, prop: str, value: str) -> str:
    return f'<{X}{subject}> <{X}{prop}> {value} .\n'


def typed(text: str, datatype: str = LONG) -> str:
    return f'"{text}"^^<{datatype}>'


def values(query: str, *graphs: tuple[str, str]) -> list[list[str]]:
    """Return the values in the rows of a query, sorted, once the graph has changed so often."""
    asked = Asked()
    for added, removed in graphs:
        asked.graph(added, removed)
    *told, answer = asked.query(f'PREFIX x: <{X}> {query}').answers()
    assert told == [{}] * len(graphs)
    assert 'rows' in answer, answer
    return sorted([text for _, text in row] for row in answer['rows'])


def test_a_graph_is_replaced_or_changed() -> None:
    query = f'SELECT ?s {{ ?s <{X}p> ?o }}'
    found = (
        Asked()
        .graph(fact('a', 'p', f'<{X}b>'), whole=True)
        .query(query)
        .graph(fact('c', 'p', f'<{X}d>'), fact('a', 'p', f'<{X}b>'))
        .query(query)
        .graph(fact('e', 'p', f'<{X}f>'))
        .query(query)
        .graph(fact('g', 'p', f'<{X}h>'), whole=True)
        .query(query)
        .answers()
    )
    rows = [sorted(row[0][1] for row in each['rows']) for each in found[1::2]]
    assert rows == [[f'{X}a'], [f'{X}c'], [f'{X}c', f'{X}e'], [f'{X}g']]
    assert found[::2] == [{}] * 4


def test_a_graph_that_cannot_be_read_is_told_and_the_next_is_taken() -> None:
    found = Asked().graph('no triple', whole=True).graph(fact('a', 'p', '"1"')).answers()
    assert found[0]['error'].startswith('the ontology is no graph: ')
    assert found[1] == {}


def test_terms_are_written_as_in_answers() -> None:
    graph = (
        fact('a', 'p', f'<{X}b>')
        + fact('a', 'p', '"text"')
        + fact('a', 'p', '"Haus"@de')
        + fact('a', 'p', typed('007'))
        + fact('a', 'p', typed('x', 'urn:after-xsd'))
        + fact('a', 'p', typed('x', 'http://x.org/#after-xsd'))
        + fact('a', 'p', '_:n')
    )
    found = [row[0] for row in values('SELECT ?o { x:a x:p ?o }', (graph, ''))]
    (blank,) = (text for text in found if text.startswith('_:'))
    assert len(blank) > 2
    assert sorted(set(found) - {blank}) == [
        '007^^' + LONG,
        'Haus@de',
        f'{X}b',
        'text',
        'x^^http://x.org/#after-xsd',
        'x^^urn:after-xsd',
    ]


def test_names_that_are_no_iris_are_read_as_from_documents() -> None:
    graph = f'<no-iri> <{X}p> <{X}b> .\n'
    assert values('SELECT ?s { ?s x:p x:b }', (graph, '')) == [['no-iri']]
    assert values('SELECT ?s { ?s x:p x:b }', (graph, ''), ('', graph)) == []


def test_a_row_has_what_it_binds() -> None:
    graph = fact('a', 'p', typed('1')) + fact('b', 'p', typed('2')) + fact('b', 'q', typed('3'))
    query = 'SELECT ?s ?v { ?s x:p ?w OPTIONAL { ?s x:q ?v } }'
    assert values(query, (graph, '')) == [[f'{X}a'], [f'{X}b', '3^^' + LONG]]


def test_a_value_comes_back_as_the_triple_has_it_in_which_it_was_found() -> None:
    graph = (
        fact('a', 'p', typed('7'))
        + fact('b', 'p', typed('07'))
        + fact('b', 'q', typed('007'))
        + fact('c', 'q', typed('8', 'http://www.w3.org/2001/XMLSchema#integer'))
    )
    ways = (graph, '')
    # The subject is in the row, or is named in the query; the property is before the variable.
    assert values('SELECT ?s ?v { ?s x:p ?v }', ways) == [
        [f'{X}a', '7^^' + LONG],
        [f'{X}b', '07^^' + LONG],
    ]
    assert values('SELECT ?v { x:b x:q ?v }', ways) == [['007^^' + LONG]]
    assert values(f'SELECT ?v {{ <{X}b> <{X}p> ?v }}', ways) == [['07^^' + LONG]]
    assert values('SELECT ?p ?v { x:b ?p ?v }', ways) == [
        [f'{X}p', '07^^' + LONG],
        [f'{X}q', '007^^' + LONG],
    ]
    assert values('SELECT ?v { x:c x:q ?v }', ways) == [
        ['8^^http://www.w3.org/2001/XMLSchema#integer']
    ]
    # What is computed is no value of the graph.
    ((total,),) = values('SELECT (SUM(?v) AS ?n) { ?s x:p ?v }', ways)
    assert total.startswith('14^^')
    ((least,),) = values('SELECT (MIN(?v) AS ?v2) { ?s x:q ?v }', ways)
    assert least == '7^^http://www.w3.org/2001/XMLSchema#integer'


def test_how_a_value_is_written_is_forgotten_with_its_last_triple() -> None:
    both = fact('a', 'p', typed('07')) + fact('b', 'p', typed('07'))
    one, other = fact('a', 'p', typed('07')), fact('b', 'p', typed('07'))
    plain = fact('c', 'p', typed('7'))
    query = 'SELECT ?v { ?s x:p ?v }'
    assert values(query, (both, ''), ('', one)) == [['07^^' + LONG]]
    assert values(query, (both, ''), ('', one), (plain, other)) == [['7^^' + LONG]]
    # Of two ways of writing without any sign, the first in order.
    assert values(query, (both + plain, ''), ('', both)) == [['7^^' + LONG]]


def test_values_that_are_written_in_one_way_come_back_so() -> None:
    xsd = 'http://www.w3.org/2001/XMLSchema#'
    written = [
        typed('1.50', xsd + 'decimal'),
        typed('2024-05-06T08:00:00.000Z', xsd + 'dateTime'),
        typed('1e3', xsd + 'double'),
        typed('-9', xsd + 'short'),
        typed('123456789012345678', xsd + 'integer'),
        typed('+5', xsd + 'int'),
        typed('1', xsd + 'boolean'),
    ]
    graph = ''.join(fact(f's{number}', 'p', each) for number, each in enumerate(written))
    expected = sorted([each[1:].replace('"^^<', '^^')[:-1]] for each in written)
    assert values('SELECT ?v { ?s x:p ?v }', (graph, '')) == expected


def test_what_leaves_the_ontology_is_refused_by_its_keyword() -> None:
    queries = {
        'SELECT * { SERVICE <http://x.org> { ?s ?p ?o } }': 'SERVICE asks another machine',
        'select * from <http://x.org> { ?s ?p ?o }': 'FROM names another graph',
    }
    asked = Asked()
    for query in queries:
        asked.query(query)
    asked.query('SELECT ?from { ?from <http://service#FROM> "SERVICE" } # FROM')
    asked.query("""SELECT * { ?s ?p 'from', '''FROM "service" ''', "a\\" FROM" }""")
    *refused, plain, quoted = asked.answers()
    for answer, words in zip(refused, queries.values(), strict=True):
        assert answer == {'error': f'{words}; expected a query of this ontology alone'}
    assert plain == quoted == {'rows': []}


def test_rows_and_characters_have_their_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = ''.join(fact(f's{number}', 'p', '"1234"') for number in range(3))
    query = 'SELECT ?v { ?s ?p ?v }'
    answers = Asked().graph(graph).query(query, 3).query(query, 2).query(query, 0).answers()
    assert len(answers[1]['rows']) == 3
    assert answers[2:] == [{'error': 'more than 2 rows'}, {'error': 'more than 0 rows'}]
    # Names and values count: 5 a row.
    for most, fits in ((15, True), (14, False)):
        monkeypatch.setattr(sparql_worker, 'MOST_CHARACTERS', most)
        answer = Asked().graph(graph).query(query).answers()[1]
        assert (
            answer == {'rows': [[['v', '1234']]] * 3}
            if fits
            else {'error': f'more than {most} characters'}
        )


def test_queries_that_cannot_be_run_say_why() -> None:
    wrong, long, ask = (
        Asked()
        .query('SELECT')
        .query(f'SELECT ?s {{ ?s {"x" * 900} }}')
        .query('ASK { ?s ?p ?o }')
        .answers()
    )
    assert wrong['error'].startswith('not valid SPARQL: ')
    assert len(long['error']) <= len('not valid SPARQL: ') + 160
    assert ask == {'error': 'expected a SELECT query'}


def test_a_process_ends_at_its_time() -> None:
    command = [sys.executable, '-m', 'armor_service.sparql_worker', str(1 << 30), '9']
    request = {'seconds': 0.2, 'query': 'SELECT * { ?s ?p ?o }', 'rows': 1}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        # The time begins with the request: what follows never comes.
        head = {'seconds': 0.2, 'whole': True, 'removed': 0, 'added': 5}
        process.stdin.write(json.dumps({**request, 'seconds': 60}).encode() + b'\n')
        process.stdin.flush()
        assert json.loads(process.stdout.readline()) == {'rows': []}
        process.stdin.write(json.dumps(head).encode() + b'\n')
        process.stdin.flush()
        assert process.wait(60.0) == -14, 'SIGALRM'
