"""Rules that compute a value from values that they derive themselves, and so never come to an end.

A rule such as ``n(?i, ?v), add(?w, ?v, 1) -> n(?i, ?w)`` has a new value for each one that it
found. Whether any such loop ends cannot be told in general; one whose rule compares the value with
anything is taken to end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from owl_reasoner.owl.axioms import Rule
from owl_reasoner.owl.expressions import BuiltinAtom, DataPropertyAtom, Variable
from owl_reasoner.owl.vocabulary import local_name

_GROWING = frozenset(
    ('add', 'subtract', 'multiply', 'divide', 'pow', 'stringConcat', 'unaryMinus', 'sin', 'cos')
)
"""Built-ins whose values are new ones again and again."""
_COMPARING = (
    'lessThan',
    'greaterThan',
    'equal',
    'notEqual',
    'stringEqual',
    'startsWith',
    'matches',
)


def endless_loop(rule: Rule, others: Iterable[Rule]) -> tuple[str, ...]:
    """Return the data properties of a loop that a rule closes, the first one again at the end.

    Args:
        rule: The rule.
        others: The rules beside it.

    Returns:
        Empty: it closes none.
    """
    following: dict[str, dict[str, None]] = {}
    for other in (rule, *others):
        for source, target, _ in _steps(other):
            following.setdefault(source, {})[target] = None
    for source, target, computes in _steps(rule):
        if computes and (path := _path(following, target, source)):
            return source, *path
    return ()


def _steps(rule: Rule) -> Iterator[tuple[str, str, bool]]:
    """Yield from which property's values a rule has which property's, and whether it computes."""
    computed: dict[object, tuple[object, ...]] = {}
    compared: set[object] = set()
    for atom in rule.body:
        if isinstance(atom, BuiltinAtom):
            name = local_name(atom.builtin)
            if name in _GROWING:
                computed[atom.arguments[0]] = atom.arguments[1:]
            elif name.startswith(_COMPARING):
                compared.update(atom.arguments)
    for head in rule.head:
        if not isinstance(head, DataPropertyAtom):
            continue
        values, pending = {head.second: None}, [head.second]
        while pending:
            for one in computed.get(pending.pop(), ()):
                if isinstance(one, Variable) and one not in values:
                    values[one] = None
                    pending.append(one)
        if compared & values.keys():
            continue
        for atom in rule.body:
            if isinstance(atom, DataPropertyAtom) and atom.second in values:
                yield atom.prop, head.prop, atom.second != head.second


def _path(following: dict[str, dict[str, None]], start: str, end: str) -> tuple[str, ...]:
    """Return a way from one property to another, both included; empty where there is none."""
    ways: dict[str, tuple[str, ...]] = {start: (start,)}
    pending = [start]
    while pending:
        here = pending.pop(0)
        if here == end:
            return ways[here]
        for beyond in following.get(here, ()):
            if beyond not in ways:
                ways[beyond] = (*ways[here], beyond)
                pending.append(beyond)
    return ()
