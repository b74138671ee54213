"""Why a class assertion does not hold although nothing speaks against it: the open world.

A definition by `exactly`, `max`, `only` or `not` asks for what an ontology must say: that there is
no more than is known. `open_definition` finds the definition of a class that is nearest to an
individual, what of it is not known, and the axioms that would state it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom, ClassAssertion, EquivalentClasses, SubClassOf
from owl_reasoner.owl.expressions import ClassExpression
from owl_reasoner.owl.vocabulary import THING, local_name

_DEEPEST = 8


@dataclass(frozen=True)
class Gap:
    """One condition of a definition that is not known to be met.

    Attributes:
        text: What is missing, in words.
        closing: What would state it: ('property', IRI) or ('class', IRI); None where a fact is
            missing, which closing does not make.
        axiom: The axiom that would state it; None likewise.
    """

    text: str
    closing: tuple[str, str] | None = None
    axiom: Axiom | None = None


@dataclass(frozen=True)
class OpenDefinition:
    """A definition that an individual would meet if the gaps were closed.

    Attributes:
        definition: The axiom.
        individual: IRI.
        gaps: What is not known.
    """

    definition: Axiom
    individual: str
    gaps: tuple[Gap, ...]

    @property
    def can_be_closed(self) -> bool:
        """Whether a closing statement is among what is missing."""
        return any(gap.closing for gap in self.gaps)

    def sentence(self, fact_text: str) -> str:
        """Return it as a sentence without a full stop."""
        listed = ' and '.join(gap.text for gap in self.gaps)
        return f'{fact_text} would follow from {axiom_text(self.definition)}, but {listed}'


def open_definition(kb: KnowledgeBase, fact: Axiom) -> OpenDefinition | None:
    """Return the definition of a class that is nearest to an individual.

    Args:
        kb: Reasoned over.
        fact: Does not hold.

    Returns:
        None where the class has no definition. One that a closing statement helps goes first.
    """
    if not isinstance(fact, ClassAssertion) or not isinstance(fact.cls, str):
        return None
    found = []
    for axiom, definition in _definitions(kb, fact.cls):
        gaps = tuple(_gaps(kb, definition, fact.individual, 0))
        if gaps:
            found.append(OpenDefinition(axiom, fact.individual, gaps))
    return min(found, key=lambda one: (not one.can_be_closed, len(one.gaps)), default=None)


def _definitions(kb: KnowledgeBase, cls: str) -> Iterator[tuple[Axiom, ClassExpression]]:
    for axiom in kb.axioms_about(cls):
        if isinstance(axiom, EquivalentClasses) and cls in axiom.classes:
            yield from ((axiom, other) for other in axiom.classes if other != cls)
        elif isinstance(axiom, SubClassOf) and axiom.sup == cls:
            yield axiom, axiom.sub


def _gaps(kb: KnowledgeBase, part: ClassExpression, ind: str, depth: int) -> Iterator[Gap]:
    """Yield what is not known of an individual that an expression asks for."""
    who = local_name(ind)
    if isinstance(part, str):
        if part != THING and part not in kb.types(ind):
            for _, definition in _definitions(kb, part) if depth < _DEEPEST else ():
                inner = tuple(_gaps(kb, definition, ind, depth + 1))
                if any(gap.closing for gap in inner):
                    yield from inner
                    return
            yield Gap(f'{who} is not known to be {local_name(part)}')
    elif isinstance(part, ex.ObjectIntersectionOf):
        for operand in part.operands:
            yield from _gaps(kb, operand, ind, depth)
    elif isinstance(part, ex.ObjectUnionOf):
        options = [tuple(_gaps(kb, operand, ind, depth)) for operand in part.operands]
        yield from min(options, key=len)
    elif isinstance(part, ex.ObjectComplementOf):
        yield from _outside(kb, part.operand, ind)
    elif isinstance(part, ex.ObjectExactCardinality):
        yield from _at_least(kb, part.prop, part.n, part.filler, ind)
        yield from _at_most(kb, part.prop, part.n, part.filler, ind)
    elif isinstance(part, ex.ObjectMinCardinality):
        yield from _at_least(kb, part.prop, part.n, part.filler, ind)
    elif isinstance(part, ex.ObjectMaxCardinality):
        yield from _at_most(kb, part.prop, part.n, part.filler, ind)
    elif isinstance(part, ex.ObjectSomeValuesFrom):
        yield from _at_least(kb, part.prop, 1, part.filler, ind)
    elif isinstance(part, ex.ObjectAllValuesFrom):
        yield from _only(kb, part, ind)


def _outside(kb: KnowledgeBase, operand: ClassExpression, ind: str) -> Iterator[Gap]:
    who = local_name(ind)
    stated = ClassAssertion(ex.ObjectComplementOf(operand), ind)
    if isinstance(operand, str):
        if operand in kb.types(ind):
            yield Gap(f'{who} is {local_name(operand)}')
        elif not kb.holds(stated):
            name = local_name(operand)
            text = f'nothing says that {who} is not {name}: state it, or close {name}'
            yield Gap(text, ('class', operand), stated)
    elif not kb.holds(stated):
        yield Gap(f'nothing says that {who} does not meet the rest of it')


def _related(kb: KnowledgeBase, prop: ex.PropertyExpression, ind: str) -> tuple[str, list[str]]:
    if isinstance(prop, ex.ObjectInverseOf):
        facts = (f for f in kb.axioms_about(ind) if getattr(f, 'object', None) == ind)
        found = {f.subject for f in facts if getattr(f, 'prop', None) == prop.prop}  # type: ignore[attr-defined]
        return f'inverse {local_name(str(prop.prop))}', sorted(found)
    return local_name(prop), sorted(kb.object_values(prop, ind))


def _within(kb: KnowledgeBase, filler: ClassExpression, names: list[str]) -> list[str]:
    if filler == THING or not isinstance(filler, str):
        return names
    return [name for name in names if filler in kb.types(name)]


def _at_least(
    kb: KnowledgeBase, prop: ex.PropertyExpression, n: int, filler: ClassExpression, ind: str
) -> Iterator[Gap]:
    name, related = _related(kb, prop, ind)
    count = len(_within(kb, filler, related))
    if count < n:
        of = f' in {local_name(filler)}' if isinstance(filler, str) and filler != THING else ''
        yield Gap(f'{local_name(ind)} has {count} {name}{of} of the {n} that it needs')


def _at_most(
    kb: KnowledgeBase, prop: ex.PropertyExpression, n: int, filler: ClassExpression, ind: str
) -> Iterator[Gap]:
    name, related = _related(kb, prop, ind)
    known, who = _within(kb, filler, related), local_name(ind)
    stated = ClassAssertion(ex.ObjectMaxCardinality(n, prop, filler), ind)
    if kb.holds(stated):
        return
    if len(known) > n:
        yield Gap(f'{who} has {len(known)} {name}, at most {n} may be')
    elif isinstance(prop, str):
        text = (
            f'nothing says that {who} has no other {name}: state it with `max {n}`, '
            f'or close {name} for {who}'
        )
        yield Gap(text, ('property', prop), stated)


def _only(kb: KnowledgeBase, part: ex.ObjectAllValuesFrom, ind: str) -> Iterator[Gap]:
    name, related = _related(kb, part.prop, ind)
    who = local_name(ind)
    others = [one for one in related if one not in _within(kb, part.filler, [one])]
    if others and isinstance(part.filler, str):
        shown = ', '.join(map(local_name, others[:3]))
        yield Gap(f'{who} {name} {shown}, not known to be {local_name(part.filler)}')
    elif isinstance(part.prop, str):
        stated = ClassAssertion(ex.ObjectMaxCardinality(len(related), part.prop, THING), ind)
        if not kb.holds(stated):
            text = f'nothing says that {who} has no other {name}: close {name} for {who}'
            yield Gap(text, ('property', part.prop), stated)
