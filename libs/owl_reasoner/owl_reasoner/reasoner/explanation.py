"""Why a fact holds: a tree of facts, each with what it follows from, that reads as English."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axiom_text import axiom_text, expression_text, literal_text
from owl_reasoner.owl.axioms import Axiom, Rule
from owl_reasoner.owl.vocabulary import local_name
from owl_reasoner.reasoner.clauses import Fact
from owl_reasoner.reasoner.datatypes import Value
from owl_reasoner.reasoner.engine import Engine, FactView
from owl_reasoner.reasoner.equality import Merge
from owl_reasoner.reasoner.proofs import Proof
from owl_reasoner.reasoner.swrl_builtins import builtin


@dataclass(frozen=True)
class Explanation:
    """One fact and why it holds.

    Attributes:
        fact_text: The fact in words, 'R3 is URGENT'.
        kind: 'asserted', 'rule' (a SWRL rule) or 'axiom' (a class or property axiom).
        because: The rule or axiom in words, '' for an asserted fact.
        premises: What the fact follows from by that rule or axiom; empty for an asserted fact.
        reason: A calculation that replaces the listing of premises in the sentence, '' where none
            is needed.
        axioms: The asserted axioms of this step: the assertion itself, or what was applied.
        background: Axioms that the derivation rests on besides those that its steps name.
    """

    fact_text: str
    kind: str
    because: str = ''
    premises: tuple[Explanation, ...] = ()
    reason: str = ''
    axioms: tuple[Axiom, ...] = ()
    background: tuple[Axiom, ...] = ()

    def sources(self) -> tuple[Axiom, ...]:
        """Return every asserted axiom of the derivation, without repeats."""
        found = dict.fromkeys((*self.axioms, *self.background))
        for premise in self.premises:
            found.update(dict.fromkeys(premise.sources()))
        return tuple(found)

    def tree(self) -> str:
        """Return the whole derivation, one fact a line, premises indented below what follows from
        them.
        """
        return '\n'.join(self._lines(0))

    def _lines(self, depth: int) -> Iterator[str]:
        note = 'asserted' if self.kind == 'asserted' else f'by {self.because}'
        detail = f' ({self.reason})' if self.reason else ''
        yield f'{"  " * depth}{self.fact_text}{detail}  [{note}]'
        for premise in self.premises:
            yield from premise._lines(depth + 1)
        for axiom in self.background:
            yield f'{"  " * (depth + 1)}{axiom_text(axiom)}  [asserted]'

    def sentence(self) -> str:
        """Return the fact and its immediate reason in one sentence without a full stop."""
        if self.kind == 'asserted':
            return f'{self.fact_text} because it is asserted'
        if self.reason:
            return f'{self.fact_text} because {self.reason}'
        texts = list(dict.fromkeys(premise.fact_text for premise in self.premises))
        if not texts:
            return f'{self.fact_text} because {self.because}'
        listed = texts[0] if len(texts) == 1 else ', '.join(texts[:-1]) + ' and ' + texts[-1]
        return f'{self.fact_text} because {listed} ({self.because})'


def _once(parts: list[Explanation]) -> tuple[Explanation, ...]:
    """Return explanations without repeats: what serves twice is told once."""
    return tuple(dict.fromkeys(parts))


_SIGNS = {
    'add': '+',
    'subtract': '-',
    'multiply': '*',
    'divide': '/',
    'greaterThan': '>',
    'greaterThanOrEqual': '>=',
    'lessThan': '<',
    'lessThanOrEqual': '<=',
    'equal': '=',
    'notEqual': '!=',
}


class Reasons:
    """Explains what one engine holds.

    Args:
        engine: Whose facts.
        justify: Gives the axioms by which assertions imply another one; none where it cannot tell.
    """

    def __init__(
        self,
        engine: Engine,
        justify: Callable[[tuple[Axiom, ...], Axiom | None], tuple[Axiom, ...]],
    ) -> None:
        self._engine = engine
        self._justification = justify
        self._merging: set[Merge] = set()
        self._view = FactView(engine)

    # --- questions ---

    def of_fact(self, axiom: Axiom) -> Explanation | None:
        """Return why an assertion holds; None when it does not."""
        engine = self._engine
        if isinstance(axiom, ax.SameIndividual):
            first, *others = sorted(axiom.individuals)
            if any(engine.equality.find(first) != engine.equality.find(name) for name in others):
                return None
            parts = [part for name in others for part in self._sameness(first, name)]
            return parts[0] if len(parts) == 1 else self._joined(axiom_text(axiom), parts)
        if isinstance(axiom, ax.DifferentIndividuals):
            names = sorted(engine.equality.find(name) for name in axiom.individuals)
            pairs = list(combinations(names, 2))
            if not all(engine.inequality.different(*pair) for pair in pairs):
                return None
            proofs = [engine.proofs.find((engine.program.different, *pair)) for pair in pairs]
            parts = [self._explained(proof) for proof in proofs if proof is not None]
            if len(parts) == 1:
                return parts[0]
            because = 'each differs from each other one'
            return Explanation(axiom_text(axiom), 'axiom', because, _once(parts))
        fact = engine.reader.fact_of(axiom)
        if fact is None or not fact[0].holds(fact):
            return None
        proof = engine.proofs.find(fact)
        if proof is None:
            return None
        explanation = self._explained(proof)
        text = axiom_text(axiom)
        if text == explanation.fact_text or isinstance(axiom, ax.DataPropertyAssertion):
            return explanation
        same = self._renamings(axiom, fact)
        return self._joined(text, [explanation, *same]) if same else explanation

    def of_inconsistency(self) -> Explanation | None:
        """Return why the facts contradict each other; None when they do not."""
        engine = self._engine
        nothing = engine.program.nothing
        for name in sorted(nothing.members):
            proof = engine.proofs.find((nothing, name))
            if proof is not None:
                found = self._explained(proof)
                return replace(found, fact_text='the ontology is inconsistent')
        return None

    # --- proofs ---

    def _explained(self, proof: Proof) -> Explanation:
        text = self.text(proof.fact)
        if proof.asserted:
            return self._assertion(proof.fact, text)
        predicate = proof.fact[0]
        program = self._engine.program
        if predicate is program.different:
            if not proof.premises:
                return self._stated_difference(proof.fact, text)
            if proof.premises[0].fact[0] is program.apart:
                return self._explained(proof.premises[0])
        if predicate is program.same:
            return self._merge(self._engine.conflicts.between(*proof.fact[1:])[0])
        premises: list[Explanation] = []
        for premise in proof.premises:
            premises += self._premise(premise)
        origin = proof.origin
        unique = _once(premises)
        if isinstance(origin, Rule):
            name = f'the rule {origin.label}' if origin.label else f'the rule {axiom_text(origin)}'
            reason = self.calculation(origin, proof)
            return Explanation(text, 'rule', name, unique, reason, (origin,))
        if isinstance(origin, Axiom):
            return Explanation(text, 'axiom', axiom_text(origin), unique, axioms=(origin,))
        named = self._justify(proof)
        if isinstance(origin, str):
            because = origin
        elif named:
            because = ' and '.join(map(axiom_text, named))
        else:
            because = 'the axioms about its classes and properties'
        return Explanation(text, 'axiom', because, unique, axioms=named)

    def _justify(self, proof: Proof) -> tuple[Axiom, ...]:
        """Return the axioms by which a step without one of its own follows from its premises."""
        assumed = [self.stated(premise.fact) for premise in proof.premises]
        goal = self.stated(proof.fact)
        is_clash = proof.fact[0] is self._engine.program.nothing
        if (goal is None and not is_clash) or not all(assumed):
            return ()
        facts = tuple(axiom for axiom in assumed if axiom is not None)
        return self._justification(facts, None if is_clash else goal)

    def stated(self, fact: Fact) -> Axiom | None:
        """Return a fact as an assertion, where it can be written as one."""
        predicate = fact[0]
        program = self._engine.program
        if predicate in (program.apart, program.different):
            return ax.DifferentIndividuals(frozenset(fact[1:]))
        name = predicate.expression
        if name is None or isinstance(name, tuple):
            return None
        if predicate.kind == 'class':
            return ax.ClassAssertion(name, fact[1])
        if predicate.kind == 'data':
            return ax.DataPropertyAssertion(name, fact[1], self._literal(fact))
        return ax.ObjectPropertyAssertion(name, fact[1], fact[2])

    def _premise(self, proof: Proof) -> list[Explanation]:
        """Return a premise; an unnamed class in between gives way to its own premises."""
        expression = proof.fact[0].expression
        unnamed = expression is not None and not isinstance(expression, str)
        if unnamed and proof.premises and not proof.asserted:
            return [part for premise in proof.premises for part in self._premise(premise)]
        return [self._explained(proof)]

    def _assertion(self, fact: Fact, text: str) -> Explanation:
        engine = self._engine
        names = [name for name in fact[1:] if isinstance(name, str)]
        for name in names:
            for other in sorted(engine.equality.same(name)):
                for axiom in engine.told.mentioning(other):
                    if isinstance(axiom, ax.Assertion) and engine.reader.fact_of(axiom) == fact:
                        written = Explanation(axiom_text(axiom), 'asserted', axioms=(axiom,))
                        same = self._renamings(axiom, fact)
                        if not same:
                            return (
                                written
                                if fact[0].kind == 'data'
                                else Explanation(text, 'asserted', axioms=(axiom,))
                            )
                        return self._joined(text, [written, *same])
        return Explanation(text, 'asserted')

    def _renamings(self, axiom: Axiom, fact: Fact) -> list[Explanation]:
        """Return why the individuals an assertion names are those of the fact."""
        if isinstance(axiom, ax.ClassAssertion):
            written: tuple[str, ...] = (axiom.individual,)
        elif isinstance(axiom, ax.ObjectPropertyAssertion):
            written = (axiom.subject, axiom.object)
        elif isinstance(axiom, ax.DataPropertyAssertion):
            written = (axiom.subject,)
        else:
            return []
        parts: list[Explanation] = []
        for name, current in zip(written, fact[1:], strict=False):
            if name != current:
                parts += self._sameness(name, current)
        return parts

    def _stated_difference(self, fact: Fact, text: str) -> Explanation:
        engine = self._engine
        _, x, y = fact
        axiom = engine.inequality.stating(engine.equality.same(x), engine.equality.same(y))
        if axiom is None:
            return Explanation(text, 'asserted')
        return Explanation(text, 'axiom', axiom_text(axiom), axioms=(axiom,))

    def _sameness(self, first: str, second: str) -> list[Explanation]:
        path = self._engine.equality.path(first, second)
        return [self._merge(merge) for merge in path if merge not in self._merging]

    def _merge(self, merge: Merge) -> Explanation:
        text = f'{local_name(merge.first)} is the same as {local_name(merge.second)}'
        if isinstance(merge.origin, ax.SameIndividual):
            return Explanation(text, 'asserted', axioms=(merge.origin,))
        # The premises were found before the merge, so no premise is explained by it.
        self._merging.add(merge)
        premises: list[Explanation] = []
        for written in merge.premises:
            proof = self._engine.proofs.find(self._engine.equality.current(written))
            if proof is not None:
                premises.append(self._explained(proof))
        self._merging.discard(merge)
        kind = 'rule' if isinstance(merge.origin, Rule) else 'axiom'
        because = axiom_text(merge.origin) if merge.origin else 'at most one is allowed'
        origin = () if merge.origin is None else (merge.origin,)
        return Explanation(text, kind, because, _once(premises), axioms=origin)

    def _joined(self, text: str, parts: list[Explanation]) -> Explanation:
        return Explanation(text, 'axiom', 'the same individual under another name', _once(parts))

    # --- words ---

    def text(self, fact: Fact) -> str:
        """Return a fact in words."""
        predicate = fact[0]
        program = self._engine.program
        subject = local_name(fact[1])
        if predicate is program.nothing:
            return f'{subject} is contradictory'
        if predicate in (program.apart, program.different):
            return f'{subject} is different from {local_name(fact[2])}'
        if predicate.kind == 'class':
            name = predicate.expression
            return f'{subject} is {expression_text(name) if name is not None else predicate.name}'
        name = local_name(predicate.name)
        if predicate.kind == 'data':
            return f'{subject} {name} {literal_text(self._literal(fact))}'
        return f'{subject} {name} {local_name(fact[2])}'

    def _literal(self, fact: Fact) -> ex.Literal:
        """Return the value of a fact as an assertion about the same individual writes it, else as
        any does.
        """
        engine = self._engine
        for name in sorted(engine.equality.same(fact[1])):
            for axiom in engine.told.mentioning(name):
                if (
                    isinstance(axiom, ax.DataPropertyAssertion)
                    and axiom.subject == name
                    and engine.reader.value(axiom.literal) == fact[2]
                ):
                    return axiom.literal
        return self._view.literal(fact[2])

    def calculation(self, rule: Rule, proof: Proof) -> str:
        """Return the rule's built-ins with the values they were applied to, '' for a rule
        without.
        """
        computed = [atom for atom in rule.body if isinstance(atom, ex.BuiltinAtom)]
        if not computed:
            return ''
        values: dict[object, Value] = {}
        texts: dict[object, str] = {}
        sources = [atom for atom in rule.body if isinstance(atom, ex.DataPropertyAtom)]
        facts = [premise.fact for premise in proof.premises]
        for source in sources:
            for fact in facts:
                if fact[0].expression == source.prop and source.second not in values:
                    values[source.second] = fact[2]
                    shown = f'{local_name(source.prop)} {literal_text(self._literal(fact))}'
                    # With several robots it matters whose value it is.
                    several = fact[1] not in proof.fact[1:] and len(fact[0].succ) > 1
                    texts[source.second] = f'{local_name(fact[1])} {shown}' if several else shown
        parts: list[str] = []
        pending = list(computed)
        while pending:
            ready = [
                atom
                for atom in pending
                if all(isinstance(a, ex.Literal) or a in values for a in atom.arguments[1:])
            ]
            if not ready:
                break
            for atom in ready:
                pending.remove(atom)
                self._calculate(atom, values, texts, parts)
        return ' and '.join(parts)

    def _calculate(
        self,
        atom: ex.BuiltinAtom,
        values: dict[object, Value],
        texts: dict[object, str],
        parts: list[str],
    ) -> None:
        name = local_name(atom.builtin)
        shown: list[str] = []
        for argument in atom.arguments:
            if isinstance(argument, ex.Literal):
                values[argument] = self._engine.reader.value(argument)
                texts[argument] = literal_text(argument)
            shown.append(texts.get(argument, ''))
        sign = _SIGNS.get(name)
        first = atom.arguments[0]
        if first not in values:
            known = builtin(name, len(atom.arguments))
            results = (
                known[1](*(values[a] for a in atom.arguments[1:])) if known and known[1] else ()
            )
            for result in results:
                values[first] = result
                calculation = (
                    f' {sign} '.join(shown[1:]) if sign else f'{name}({", ".join(shown[1:])})'
                )
                texts[first] = f'{calculation} = {literal_text(self._view.literal(result))}'
                break
        elif sign and len(shown) == 2:
            parts.append(f'{shown[0]} {sign} {shown[1]}')
        else:
            parts.append(f'{name}({", ".join(shown)})')
