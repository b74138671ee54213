"""Rules that would never come to an end, told when they are added, not at each change after it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from armor_service.changes import AddAxiom, Change
from armor_service.reference import Reference
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom, Rule
from owl_reasoner.owl.vocabulary import local_name
from owl_reasoner.reasoner.endless_rules import endless_loop


def doubtful_rules(ref: Reference, changes: Iterable[Change]) -> Iterator[str]:
    """Yield one sentence for each rule that changes add and that closes a loop without an end."""
    added = [
        change.axiom
        for change in changes
        if isinstance(change, AddAxiom) and isinstance(change.axiom, Rule)
    ]
    if added:
        yield from endless_rules(added, [*added, *ref.kb.axioms()])


def endless_rules(rules: Iterable[Rule], axioms: Iterable[Axiom]) -> Iterator[str]:
    """Yield one sentence for each of some rules that closes a loop with others."""
    others = [axiom for axiom in axioms if isinstance(axiom, Rule)]
    for rule in rules:
        loop = endless_loop(rule, others)
        if loop:
            path = ' to '.join(map(local_name, loop))
            yield f'{axiom_text(rule)} computes new values without an end: from {path}'
