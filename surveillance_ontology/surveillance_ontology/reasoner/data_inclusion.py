"""Which data ranges are known to include which."""

from __future__ import annotations

from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.vocabulary import OWL, TOP_LITERAL, XSD
from surveillance_ontology.reasoner.datatypes import range_test, value_of


def includes(outer: ex.DataRange, inner: ex.DataRange) -> bool:
    """Whether every value of `inner` is known to be in `outer` (sound, not complete)."""
    if outer in (inner, TOP_LITERAL):
        return True
    if isinstance(inner, ex.DatatypeRestriction):
        return includes(outer, inner.datatype)
    if isinstance(inner, ex.DataOneOf):
        test = range_test(outer)
        return test is not None and all(test(value_of(literal)) for literal in inner.literals)
    if isinstance(inner, ex.DataUnionOf):
        return all(includes(outer, operand) for operand in inner.operands)
    if isinstance(inner, ex.DataIntersectionOf):
        return any(includes(outer, operand) for operand in inner.operands)
    if isinstance(outer, ex.DataUnionOf):
        return any(includes(operand, inner) for operand in outer.operands)
    if isinstance(outer, str) and isinstance(inner, str):
        return outer in _WIDER.get(inner, ())
    return False


def _wider() -> dict[str, set[str]]:
    below = {
        'decimal': ('integer',),
        'integer': ('nonPositiveInteger', 'long', 'nonNegativeInteger'),
        'nonPositiveInteger': ('negativeInteger',),
        'long': ('int', 'unsignedInt'),
        'int': ('short', 'unsignedShort'),
        'short': ('byte', 'unsignedByte'),
        'nonNegativeInteger': ('positiveInteger', 'unsignedLong'),
        'unsignedLong': ('unsignedInt',),
        'unsignedInt': ('unsignedShort',),
        'unsignedShort': ('unsignedByte',),
        'string': ('normalizedString',),
        'normalizedString': ('token',),
        'token': ('language', 'NMTOKEN', 'Name'),
        'Name': ('NCName',),
        'dateTime': ('dateTimeStamp',),
    }
    wider: dict[str, set[str]] = {}

    def mark(name: str, above: set[str]) -> None:
        wider.setdefault(XSD + name, set()).update(above)
        for child in below.get(name, ()):
            mark(child, above | {XSD + name})

    for name in below:
        mark(name, set())
    for name in ('decimal', 'integer'):
        wider.setdefault(XSD + name, set()).update((OWL + 'real', OWL + 'rational'))
    return wider


_WIDER = _wider()
