"""Which data ranges are known to include which."""

from __future__ import annotations

from surveillance_ontology import axioms as ax
from surveillance_ontology.reasoner.datatypes import range_test, value_of


def includes(outer: ax.DataRange, inner: ax.DataRange) -> bool:
    """Whether every value of `inner` is known to be in `outer` (sound, not complete)."""
    if outer == inner or outer == ax.TOP_LITERAL:
        return True
    if isinstance(inner, ax.DatatypeRestriction):
        return includes(outer, inner.datatype)
    if isinstance(inner, ax.DataOneOf):
        test = range_test(outer)
        return test is not None and all(test(value_of(literal)) for literal in inner.literals)
    if isinstance(inner, ax.DataUnionOf):
        return all(includes(outer, operand) for operand in inner.operands)
    if isinstance(inner, ax.DataIntersectionOf):
        return any(includes(outer, operand) for operand in inner.operands)
    if isinstance(outer, ax.DataUnionOf):
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
        wider.setdefault(ax.XSD + name, set()).update(above)
        for child in below.get(name, ()):
            mark(child, above | {ax.XSD + name})

    for name in below:
        mark(name, set())
    for name in ('decimal', 'integer'):
        wider.setdefault(ax.XSD + name, set()).update((ax.OWL + 'real', ax.OWL + 'rational'))
    return wider


_WIDER = _wider()
