"""Each form of RDF/XML as its specification has it, as triples, and each error with its place.

The forms are those of the W3C's RDF 1.1 XML Syntax (https://www.w3.org/TR/rdf-syntax-grammar/),
sections 2 and 7.
"""

from __future__ import annotations

import pytest

from owl_reasoner import OntologyFileError
from owl_reasoner.documents.rdf_xml import parse_rdf_xml
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import RDF, XSD

HEAD = (
    '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:e="http://e/"'
    ' xml:base="http://b/d">\n'
)
P, Q, R = 'http://e/p', 'http://e/q', 'http://e/r'
S, B = 'http://b/s', '_:g1'
TYPE = RDF + 'type'


def triples(body: str) -> list[tuple[str, str, str | Literal]]:
    return list(parse_rdf_xml((HEAD + body + '</rdf:RDF>').encode(), 'http://other/').triples)


def in_language(text: str, tag: str) -> Literal:
    return Literal(text, RDF + 'langString', tag)


@pytest.mark.parametrize(
    ('body', 'expected'),
    [
        ('<e:C rdf:about="s"/>', [(S, TYPE, 'http://e/C')]),
        (
            '<rdf:Description rdf:about="s"><e:p> a </e:p></rdf:Description>',
            [(S, P, Literal(' a '))],
        ),
        ('<rdf:Description rdf:about="s"><e:p/></rdf:Description>', [(S, P, Literal(''))]),
        (
            '<rdf:Description rdf:ID="s"><e:p>a</e:p></rdf:Description>',
            [('http://b/d#s', P, Literal('a'))],
        ),
        ('<rdf:Description><e:p>a</e:p></rdf:Description>', [(B, P, Literal('a'))]),
        (
            '<rdf:Description rdf:nodeID="x"><e:p rdf:nodeID="y"/></rdf:Description>',
            [('_:nx', P, '_:ny')],
        ),
        (
            '<rdf:Description rdf:about="_:x"><e:p rdf:resource="_:y"/></rdf:Description>',
            [('_:nx', P, '_:ny')],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:resource="#o"/></rdf:Description>',
            [(S, P, 'http://b/d#o')],
        ),
        (
            '<rdf:Description rdf:about=""><e:p rdf:resource=""/></rdf:Description>',
            [('http://b/d', P, 'http://b/d')],
        ),
        (
            '<rdf:Description rdf:about="s" e:p="a" xml:lang="EN"/>',
            [(S, P, in_language('a', 'en'))],
        ),
        (
            '<rdf:Description rdf:about="s" rdf:type="o" e:q="b"/>',
            [(S, TYPE, 'http://b/o'), (S, Q, Literal('b'))],
        ),
        (
            '<rdf:Description rdf:about="s" xml:lang="en"><e:p>a</e:p>'
            '<e:q xml:lang="de-AT">b</e:q><e:r xml:lang="">c</e:r></rdf:Description>',
            [
                (S, P, in_language('a', 'en')),
                (S, Q, in_language('b', 'de-at')),
                (S, R, Literal('c')),
            ],
        ),
        (
            '<rdf:Description rdf:about="s" xml:lang="en">'
            f'<e:p rdf:datatype="{XSD}int">5</e:p><e:q rdf:datatype="t">5</e:q></rdf:Description>',
            [(S, P, Literal('5', XSD + 'int')), (S, Q, Literal('5', 'http://b/t'))],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p><e:C rdf:about="o"><e:q>b</e:q></e:C></e:p>'
            '</rdf:Description>',
            [
                ('http://b/o', TYPE, 'http://e/C'),
                ('http://b/o', Q, Literal('b')),
                (S, P, 'http://b/o'),
            ],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p e:q="b"/></rdf:Description>',
            [(B, Q, Literal('b')), (S, P, B)],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:resource="o" e:q="b" rdf:type="c"/>'
            '</rdf:Description>',
            [
                ('http://b/o', Q, Literal('b')),
                ('http://b/o', TYPE, 'http://b/c'),
                (S, P, 'http://b/o'),
            ],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:nodeID="x" e:q="b"/></rdf:Description>',
            [('_:nx', Q, Literal('b')), (S, P, '_:nx')],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:parseType="Resource"><e:q>b</e:q>'
            '<e:r>c</e:r></e:p><e:r>d</e:r></rdf:Description>',
            [(S, P, B), (B, Q, Literal('b')), (B, R, Literal('c')), (S, R, Literal('d'))],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:parseType="Collection">'
            '<e:C rdf:about="o"/><rdf:Description/></e:p></rdf:Description>',
            [
                ('http://b/o', TYPE, 'http://e/C'),
                ('_:g2', RDF + 'first', '_:g1'),
                ('_:g2', RDF + 'rest', RDF + 'nil'),
                ('_:g3', RDF + 'first', 'http://b/o'),
                ('_:g3', RDF + 'rest', '_:g2'),
                (S, P, '_:g3'),
            ],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:parseType="Collection"/></rdf:Description>',
            [(S, P, RDF + 'nil')],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:parseType="Literal">a <e:b at="1">c</e:b> d'
            '</e:p><e:q rdf:parseType="Literal">e &amp; f</e:q></rdf:Description>',
            [
                (S, P, Literal('a <e:b at="1">c</e:b> d', RDF + 'XMLLiteral')),
                (S, Q, Literal('e & f', RDF + 'XMLLiteral')),
            ],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:parseType="Literal" rdf:ID="i"><e:b>&gt;'
            '<e:c/></e:b></e:p></rdf:Description>',
            [
                (S, P, Literal('<e:b>&gt;<e:c/></e:b>', RDF + 'XMLLiteral')),
                ('http://b/d#i', TYPE, RDF + 'Statement'),
                ('http://b/d#i', RDF + 'subject', S),
                ('http://b/d#i', RDF + 'predicate', P),
                (
                    'http://b/d#i',
                    RDF + 'object',
                    Literal('<e:b>&gt;<e:c/></e:b>', RDF + 'XMLLiteral'),
                ),
            ],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:ID="i">a</e:p></rdf:Description>',
            [
                (S, P, Literal('a')),
                ('http://b/d#i', TYPE, RDF + 'Statement'),
                ('http://b/d#i', RDF + 'subject', S),
                ('http://b/d#i', RDF + 'predicate', P),
                ('http://b/d#i', RDF + 'object', Literal('a')),
            ],
        ),
        (
            '<rdf:Description rdf:about="s"><e:p rdf:ID="i" rdf:resource="o"/></rdf:Description>',
            [
                (S, P, 'http://b/o'),
                ('http://b/d#i', TYPE, RDF + 'Statement'),
                ('http://b/d#i', RDF + 'subject', S),
                ('http://b/d#i', RDF + 'predicate', P),
                ('http://b/d#i', RDF + 'object', 'http://b/o'),
            ],
        ),
        (
            '<rdf:Bag rdf:about="s"><rdf:li>a</rdf:li><e:p>b</e:p><rdf:li>c</rdf:li></rdf:Bag>'
            '<rdf:Bag rdf:about="t"><rdf:li>d</rdf:li></rdf:Bag>',
            [
                (S, TYPE, RDF + 'Bag'),
                (S, RDF + '_1', Literal('a')),
                (S, P, Literal('b')),
                (S, RDF + '_2', Literal('c')),
                ('http://b/t', TYPE, RDF + 'Bag'),
                ('http://b/t', RDF + '_1', Literal('d')),
            ],
        ),
        (
            '<rdf:Description rdf:about="s" xml:base="http://c/"><e:p rdf:resource="o"/>'
            '<e:q xml:base="http://d/" rdf:resource="o"/></rdf:Description>',
            [('http://c/s', P, 'http://c/o'), ('http://c/s', Q, 'http://d/o')],
        ),
    ],
)
def test_each_form_means_its_triples(
    body: str, expected: list[tuple[str, str, str | Literal]]
) -> None:
    assert triples(body) == expected


def test_one_element_is_a_document() -> None:
    text = b'<e:C xmlns:e="http://e/" xmlns:x="http://x/"><e:p>a</e:p></e:C>'
    graph = parse_rdf_xml(text, 'http://b/')
    assert graph.triples == [(B, TYPE, 'http://e/C'), (B, P, Literal('a'))]
    assert graph.places == {B: (1, 1)}
    assert graph.prefixes == {'e': 'http://e/', 'x': 'http://x/'}


@pytest.mark.parametrize(
    ('body', 'place', 'message'),
    [
        ('<C/>', (2, 1), "element 'C' has no namespace"),
        (' text <e:C/>', (2, 7), "text 'text' where an element is expected"),
        (
            '<e:C rdf:about="a" rdf:ID="b"/>',
            (2, 1),
            'expected one of rdf:about, rdf:ID and rdf:nodeID',
        ),
        (
            '<e:C rdf:nodeID="a" rdf:ID="b"/>',
            (2, 1),
            'expected one of rdf:about, rdf:ID and rdf:nodeID',
        ),
        ('<e:C rdf:ID="a"/><e:C rdf:ID="a"/>', (2, 18), "rdf:ID 'a' stands twice in the document"),
        ('<e:C rdf:nodeID="a b"/>', (2, 1), "rdf:nodeID 'a b' is no name"),
        ('<e:C rdf:nodeID="1"/>', (2, 1), "rdf:nodeID '1' is no name"),
        ('<e:C q="a"/>', (2, 1), "attribute 'q' has no namespace"),
        (
            '<e:C rdf:parseType="Resource"/>',
            (2, 1),
            f"attribute '{RDF}parseType' does not belong here",
        ),
        ('<e:C><p/></e:C>', (2, 6), "property element 'p' has no namespace"),
        (
            '<e:C>\n <e:p rdf:resource="a" rdf:nodeID="b"/></e:C>',
            (3, 2),
            "property 'http://e/p' has attributes that exclude each other",
        ),
        (
            '<e:C><e:p rdf:parseType="Resource" e:q="b"/></e:C>',
            (2, 6),
            "property 'http://e/p' has attributes that exclude each other",
        ),
        (
            '<e:C><e:p rdf:datatype="t" e:q="b"/></e:C>',
            (2, 6),
            "property 'http://e/p' has attributes that exclude each other",
        ),
        (
            '<e:C><e:p><e:C/><e:D/></e:p></e:C>',
            (2, 17),
            "second value 'http://e/D' inside one property element",
        ),
        ('<e:C><e:p><e:C/> b </e:p></e:C>', (2, 20), "text 'b' beside an element"),
        (
            '<e:C><e:p rdf:datatype="t"><e:C/></e:p></e:C>',
            (2, 34),
            'an element where rdf:datatype announces text',
        ),
        (
            '<e:C><e:p rdf:resource="a"><e:C/></e:p></e:C>',
            (2, 28),
            "element 'http://e/C' inside a property that has its value already",
        ),
        (
            '<e:C><e:p rdf:resource="a">b</e:p></e:C>',
            (2, 29),
            "text 'b' where an element is expected",
        ),
    ],
)
def test_each_error_names_its_place(body: str, place: tuple[int, int], message: str) -> None:
    with pytest.raises(OntologyFileError) as error:
        triples(body)
    assert (error.value.message, error.value.line, error.value.column) == (message, *place)


def test_a_document_needs_a_namespace_and_an_element() -> None:
    with pytest.raises(OntologyFileError, match="expected rdf:RDF, got element 'html'"):
        parse_rdf_xml(b'<html/>', 'http://b/')
    with pytest.raises(OntologyFileError, match='no element'):
        parse_rdf_xml(b'', 'http://b/')
