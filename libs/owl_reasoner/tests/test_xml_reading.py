"""XML as ontology documents use it, beside another parser and the examples of RFC 3986."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from owl_reasoner.documents.xml_reading import (
    OntologyFileError,
    XmlReader,
    is_absolute,
    legal,
    percent_encoded,
    resolve,
)


class Collector(XmlReader):
    """Keeps elements and texts as ElementTree has them."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self.found: list[tuple[str, dict[str, str]]] = []
        self.text = ''
        self.ends = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Keep an element."""
        self.found.append((name, attributes))

    def end(self, name: str) -> None:
        """Count an end."""
        self.ends += 1

    def characters(self, text: str) -> None:
        """Keep text."""
        self.text += text


def read(text: str) -> Collector:
    collector = Collector(text.encode())
    collector.read()
    assert collector.depth == 0
    assert collector.ends == len(collector.found)
    return collector


def refused(text: str | bytes) -> tuple[str, int, int]:
    collector = Collector(text.encode() if isinstance(text, str) else text)
    with pytest.raises(OntologyFileError) as caught:
        collector.read()
    return caught.value.message, caught.value.line, caught.value.column


def declared(value: str, name: str = 'e') -> str:
    return f"<!DOCTYPE a [\n  <!ENTITY {name} '{value}'>\n]>\n<a b='&{name};'>&{name};</a>"


@pytest.mark.parametrize(
    'value',
    [
        'plain',
        '',
        'http://x/o#a&amp;b',
        '&#38;#38;&#38;lt;&#38;gt;&#38;quot;&#38;apos;',
        '&#38;#1114111;&#38;#x10FFFF;',
        'Größe\t ',
        'x' * 512,
    ],
)
def test_an_entity_stands_for_its_text(value: str) -> None:
    text = declared(value)
    other = ElementTree.fromstring(text)
    found = read(text)
    assert found.text == (other.text or '')
    assert found.found == [('a', other.attrib)]


@pytest.mark.parametrize(
    'value',
    [
        *('x' * 513, '<b/>', '&#60;b/>', '&r;', '&amp;&r;', '&#38;r;', '&#38;amp', 'a & b;'),
        *('&#38;#12345678;', '&#38;#x1234567;', '&#38;#x;', '&#38;#;'),
    ],
)
def test_what_an_entity_may_not_stand_for(value: str) -> None:
    message, line, _ = refused(declared(value))
    if value == 'a & b;':
        assert message.startswith('not well-formed XML')
    else:
        assert message == (
            "entity 'e' is refused: expected plain text of at most 512 characters, no other entity"
        )
    assert line == 2


@pytest.mark.parametrize(
    ('declaration', 'name'),
    [
        ("<!ENTITY e SYSTEM 'file:///etc/hostname'>", 'e'),
        ("<!ENTITY e PUBLIC '-//X' 'http://x/e'>", 'e'),
        ("<!ENTITY % p 'text'>", 'p'),
        ("<!ENTITY % p SYSTEM 'p.dtd'>", 'p'),
    ],
)
def test_external_and_parameter_entities_are_refused(declaration: str, name: str) -> None:
    message, line, _ = refused(f'<!DOCTYPE a [\n{declaration}]><a/>')
    assert message == f"entity '{name}' is refused: only plain text may stand in an entity"
    assert line == 2


@pytest.mark.parametrize('place', ["<a b='&{};'/>", '<a>&{};</a>'])
@pytest.mark.parametrize('name', ['e', 'Größe', '_e.1-x'])
def test_an_entity_of_a_file_that_is_not_read_is_refused(place: str, name: str) -> None:
    # A parser leaves it out without a word, since the file could declare it.
    lines = "<!DOCTYPE a SYSTEM 'x.dtd' [<!ENTITY e2 '&amp;'>]>\n\n"
    body = place.format(name)
    assert refused(lines + body) == (f"entity '{name}' is not declared here", 3, 1)
    known = "<!DOCTYPE a SYSTEM 'x.dtd'\n[<!ENTITY " + name + " 'x'>]>\n" + body
    assert 'x' in (read(known).text, read(known).found[0][1].get('b'))
    for always in ('amp', 'lt', 'gt', 'quot', 'apos', '#38', '#x26'):
        read(lines + place.format(always))
    for other in ('<!-- R&D; \n-->', '<?p &D;\n?>', '<a><![CDATA[&D;\n]]></a>'):
        read(lines + (other if other.startswith('<a>') else f'{other}<a/>'))
        inside = f'<a>{other}{place.format(name)}</a>'
        assert refused(lines + inside)[:2] == (f"entity '{name}' is not declared here", 4)
    assert refused(body)[0] == 'not well-formed XML: undefined entity'


def test_bytes_that_are_no_text_are_an_error_of_the_document() -> None:
    message, line, _ = refused(b"<!DOCTYPE a SYSTEM 'x.dtd'>\n<a>&\xff;</a>")
    assert (message, line) == ("entity '\ufffd' is not declared here", 2)
    assert refused(b'<a>\xff</a>')[0].startswith('not well-formed XML')


def test_an_error_names_its_line_and_column() -> None:
    assert refused('<a>\n  <b></a>') == ('not well-formed XML: mismatched tag', 2, 8)
    assert refused('') == ('not well-formed XML: no element found', 1, 1)


def test_elements_nest_as_deep_as_they_may() -> None:
    read('<a>' + '<b/>' * 3 + '</a>')
    read('<a>' * 20_000 + '</a>' * 20_000)
    message, line, column = refused('<a>' * 20_001)
    assert message == 'elements nest deeper than 20000'
    assert (line, column) == (1, 3 * 20_000 + 1)


def test_a_language_is_of_the_element_or_of_the_one_around() -> None:
    class Languages(Collector):
        def start(self, name: str, attributes: dict[str, str]) -> None:
            outer = self.found[-1][0] if self.found else ''
            self.found.append((self.language(attributes, outer), attributes))

    reader = Languages(b"<a xml:lang='en_US'>\n<b/><b xml:lang='d!'/><b c='1' xml:lang=''/></a>")
    reader.read()
    assert reader.found == [('en-us', {}), ('en-us', {}), ('', {}), ('', {'c': '1'})]
    assert reader.unsupported == ["line 2: xml:lang 'd!' is no language tag"]


def test_an_iri_of_a_document_is_one_text_and_reported_once() -> None:
    reader = Collector(b'<a/>')
    long, again = ('http://x/' + 'o' * 40 for _ in range(2))
    assert reader.resolve('urn:b', long) is reader.resolve('urn:c', again)
    assert reader.resolve('http://x/o', '#a b') == 'http://x/o#a%20b'
    assert reader.resolve('http://y/o', '#a b') == 'http://y/o#a%20b'
    assert reader.resolve('http://x/o', '#c') == 'http://x/o#c'
    assert reader.resolve('http://y/o', '#c') == 'http://y/o#c'
    assert reader.unsupported == ["IRI '#a b' contains ' ', it is read as <#a%20b>"]
    reader.read()
    with pytest.raises(
        OntologyFileError, match=re.escape("IRI '//[x' with base 'http://x/o'")
    ) as e:
        reader.resolve('http://x/o#f', '//[x')
    assert e.value.line == 1


def test_what_no_iri_may_hold() -> None:
    assert percent_encoded('urn:a b<>"{}|\\^`\n~é') == 'urn:a%20b%3C%3E%22%7B%7D%7C%5C%5E%60%0A~é'
    reports: list[str] = []
    known: dict[str, str] = {}
    assert [legal(iri, known, reports) for iri in ('u:a', 'u:{', 'u:{', 'u:}')] == [
        *('u:a', 'u:%7B', 'u:%7B', 'u:%7D')
    ]
    assert [report[:16] for report in reports] == ["IRI 'u:{' contai", "IRI 'u:}' contai"]


# RFC 3986, sections 5.4.1 and 5.4.2; an empty one is the document itself (RDF/XML, 5.3).
RFC_3986 = """g:h g:h|g http://a/b/c/g|./g http://a/b/c/g|g/ http://a/b/c/g/|/g http://a/g|//g http://g|
?y http://a/b/c/d;p?y|g?y http://a/b/c/g?y|#s http://a/b/c/d;p?q#s|g#s http://a/b/c/g#s|
g?y#s http://a/b/c/g?y#s|;x http://a/b/c/;x|g;x http://a/b/c/g;x|g;x?y#s http://a/b/c/g;x?y#s|
. http://a/b/c/|./ http://a/b/c/|.. http://a/b/|../ http://a/b/|../g http://a/b/g|
../.. http://a/|../../ http://a/|../../g http://a/g|../../../g http://a/g|../../../../g http://a/g|
/./g http://a/g|/../g http://a/g|g. http://a/b/c/g.|.g http://a/b/c/.g|g.. http://a/b/c/g..|
..g http://a/b/c/..g|./../g http://a/b/g|./g/. http://a/b/c/g/|g/./h http://a/b/c/g/h|
g/../h http://a/b/c/h|g;x=1/./y http://a/b/c/g;x=1/y|g;x=1/../y http://a/b/c/y|
g?y/./x http://a/b/c/g?y/./x|g?y/../x http://a/b/c/g?y/../x|g#s/./x http://a/b/c/g#s/./x|
g#s/../x http://a/b/c/g#s/../x|http:g http:g"""


@pytest.mark.parametrize('example', RFC_3986.replace('\n', '').split('|'))
@pytest.mark.parametrize('fragment', ['', '#f'])
def test_references_are_resolved_as_in_the_examples_of_rfc_3986(
    example: str, fragment: str
) -> None:
    reference, result = example.split(' ')
    assert resolve('http://a/b/c/d;p?q' + fragment, reference) == result


def test_references_that_the_examples_leave_out() -> None:
    base = 'http://a/b?q#f'
    assert resolve(base, '') == 'http://a/b?q'
    assert [resolve(base, end) for end in ('#', 'g#', 'g?', 'g?#')] == [
        *('http://a/b?q#', 'http://a/g#', 'http://a/g?', 'http://a/g?#')
    ]
    assert [is_absolute(one) for one in ('a:', 'a+1.-:b', '1a:', ':a', 'a/b:c', '#a:b')] == [
        *(True, True, False, False, False, False)
    ]


@pytest.mark.parametrize(
    ('error', 'text'),
    [
        (OntologyFileError('a \n  b'), 'a b'),
        (OntologyFileError('a', 3, 7), 'a'),
        (OntologyFileError('a', path='o.owl'), 'o.owl: a'),
        (OntologyFileError('a', 3, 7, 'o.owl'), 'o.owl:3:7: a'),
        (OntologyFileError('a', 1, 1, 'o.owl'), 'o.owl:1:1: a'),
    ],
)
def test_an_error_is_one_line_with_its_place(error: OntologyFileError, text: str) -> None:
    assert str(error) == text
