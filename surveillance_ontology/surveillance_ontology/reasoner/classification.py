"""The part of an ontology that is not about individuals: its program, completed, and its class
hierarchy.

What follows from a class alone is found by trying: a prototype individual is asserted to be a
member, what it must be related to is made up as further individuals down to a bounded depth, and
the engine shows what else the prototype is. Rules take no part, since they speak of named
individuals only. What a class implies only through such made-up individuals is added to the program
as clauses, so that the engine over real individuals needs none.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import count

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import ClassExpression
from surveillance_ontology.owl.vocabulary import NOTHING, THING
from surveillance_ontology.reasoner.clauses import (
    Clause,
    Constant,
    Existential,
    Fact,
    Predicate,
    PredicateAtom,
    Program,
)
from surveillance_ontology.reasoner.datatypes import Value
from surveillance_ontology.reasoner.engine import Engine
from surveillance_ontology.reasoner.simplify import simplify
from surveillance_ontology.reasoner.translation import Translation

_ROOT = '_:prototype'
_MADE_UP = '_:made'
_MAX_DEPTH = 3
_MAX_MADE_UP = 200
_MAX_PAIRS = 400
_MAX_COUNT = 12
_MAX_PROPERTIES = 24
_EXISTENTIALS = (ex.ObjectSomeValuesFrom, ex.ObjectMinCardinality)
_RESTRICTIONS = (
    *_EXISTENTIALS,
    ex.ObjectAllValuesFrom,
    ex.ObjectMaxCardinality,
    ex.DataAllValuesFrom,
    ex.DataMaxCardinality,
)


# What a prototype turned out to be: a member of a class, or related to a named individual or a
# value, as
# (predicate, whether it is the second argument, the other argument).
Finding = Predicate | tuple[Predicate, bool, Value]


class Schema:
    """Builds the program and the hierarchy of named classes.

    Args:
        axioms: The ontology's axioms; of its assertions only the complex classes matter.
        asserted: Complex class expressions that individuals are asserted to belong to.
        negated: Properties with negative assertions, as pairs (kind, IRI).

    Attributes:
        program: To be run by one `Engine`.
    """

    def __init__(
        self,
        axioms: Iterable[Axiom],
        asserted: Iterable[ClassExpression] = (),
        negated: Iterable[tuple[str, str]] = (),
    ) -> None:
        tbox = [axiom for axiom in axioms if not isinstance(axiom, ax.Assertion)]
        asserted, negated = tuple(asserted), tuple(negated)
        self.program = Translation(tbox, asserted, negated).program
        self._above: dict[str, frozenset[str]] = {}
        self._impossible: set[str] = set()
        self._classes = [
            axiom.iri
            for axiom in tbox
            if isinstance(axiom, ax.Declaration) and axiom.kind == 'class'
        ]
        without_rules = [axiom for axiom in tbox if not isinstance(axiom, ax.Rule)]
        prototypes = _Prototypes(Translation(without_rules, asserted, abstract=True))
        self._hierarchy(prototypes)
        self._exclusions(prototypes)
        labels = [self.program.labels[expression] for expression in asserted]
        simplify(self.program, labels)

    # --- class hierarchy ---

    def superclasses(self, cls: str) -> set[str]:
        """Named classes strictly above; of a class that can have no members, every other class."""
        if cls in self._impossible:
            return {name for name in self._above if name != cls}
        return set(self._above.get(cls, ())) - {cls}

    def subclasses(self, cls: str) -> set[str]:
        """Named classes strictly below, those that can have no members included."""
        found = {name for name, above in self._above.items() if cls in above}
        return (found | self._impossible) - {cls}

    def classes(self) -> set[str]:
        """Every named class."""
        return set(self._above)

    def unsatisfiable(self) -> set[str]:
        """Named classes that can have no members."""
        return set(self._impossible)

    def _hierarchy(self, prototypes: _Prototypes) -> None:
        names = dict.fromkeys([*self._classes, *self.program.classes])
        for name in names:
            self._above[name] = frozenset()
        extra: dict[Clause, None] = {}
        for name in names:
            own = prototypes.program.cls(name)
            found = prototypes.consequences((own,))
            if found is None:
                self._impossible.add(name)
                extra[self._clause((own,), None)] = None
                continue
            self._above[name] = frozenset(
                finding.expression
                for finding in found
                if isinstance(finding, Predicate) and isinstance(finding.expression, str)
            )
            plain = prototypes.consequences((own,), make_up=False) or set()
            for finding in found - plain:
                extra[self._clause((own,), finding)] = None
        existentials = list(
            dict.fromkeys(existential.label for existential in prototypes.program.existentials)
        )
        alone: dict[Predicate, set[Finding]] = {}
        for label in existentials:
            found = prototypes.consequences((label,))
            plain = prototypes.consequences((label,), make_up=False) or set()
            alone[label] = found or set()
            if found is None:
                extra[self._clause((label,), None)] = None
            else:
                for finding in found - plain:
                    extra[self._clause((label,), finding)] = None
        pairs = [
            (label, other) for label in existentials for other in prototypes.interacting(label)
        ]
        if len(pairs) > _MAX_PAIRS:
            del pairs[_MAX_PAIRS:]
            self.program.unsupported.append(
                f'the class hierarchy: of the pairs of restrictions on one property, {_MAX_PAIRS}'
                ' are looked at together, the others each alone'
            )
        for label, other in pairs:
            both = prototypes.consequences((label, other))
            known = prototypes.consequences((label, other), make_up=False) or set()
            if both is None:
                extra[self._clause((label, other), None)] = None
                continue
            for finding in both - known - alone[label] - alone.get(other, set()):
                extra[self._clause((label, other), finding)] = None
        self.program.clauses += [clause for clause in extra if clause.head not in clause.body]

    def _exclusions(self, prototypes: _Prototypes) -> None:
        """Finds the properties that can relate nothing to itself, or never the same two
        individuals.
        """
        program = self.program
        if not (program.irreflexive or program.asymmetric or program.disjoint_properties):
            return
        props = list(program.objects)[:_MAX_PROPERTIES]
        known = set(program.irreflexive)
        for name in props:
            if program.objects[name] not in known and prototypes.excludes((name, False)):
                program.irreflexive.append(program.objects[name])
        pairs = set(program.disjoint_properties)
        for place, name in enumerate(props):
            for other in props[place:]:
                for turned in (False, True):
                    pair = (program.objects[name], False, program.objects[other], turned)
                    if pair in pairs or (name == other and not turned):
                        continue
                    if prototypes.excludes((name, False), (other, turned), loop=False):
                        program.disjoint_properties.append(pair)

    def _own(self, predicate: Predicate) -> Predicate:
        """The predicate of this program that stands for the same expression."""
        if isinstance(predicate.expression, str):
            return self.program.cls(predicate.expression)
        found = self.program.labels.get(predicate.expression)
        if found is None:
            found = Predicate('class', predicate.name, predicate.expression)
            self.program.labels[predicate.expression] = found
        return found

    def _clause(self, body: tuple[Predicate, ...], head: Finding | None) -> Clause:
        program = self.program
        atoms = tuple(PredicateAtom(self._own(predicate), (0,)) for predicate in body)
        if isinstance(head, tuple):
            predicate, turned, other = head
            if predicate.kind == 'data':
                atom = PredicateAtom(program.data(predicate.name), (0, Constant(other, True)))
            else:
                terms = (Constant(other), 0) if turned else (0, Constant(other))
                atom = PredicateAtom(program.object(predicate.name), terms)
            return Clause(atoms, atom)
        conclusion = program.nothing if head is None else self._own(head)
        return Clause(atoms, PredicateAtom(conclusion, (0,)))


class _Prototypes:
    """Tries out what members of classes must be."""

    def __init__(self, translation: Translation) -> None:
        self.program: Program = translation.program
        self._hierarchy = translation.hierarchy
        fillers = [
            existential.filler
            for existential in self.program.existentials
            if existential.prop.kind == 'object'
        ]
        labels: dict[object, Predicate] = {}
        for filler in fillers:
            if not isinstance(filler, str) and filler not in labels:
                labels[filler] = translation.label_asserted(filler)  # type: ignore[arg-type]
        self._labels = labels
        self._engine = Engine(self.program, lambda _: ())

    def _filled(self, existential: Existential) -> Predicate | None:
        filler = existential.filler
        if isinstance(filler, str):
            if filler == NOTHING:
                return self.program.nothing
            return None if filler == THING else self.program.cls(filler)
        return self._labels[filler]

    def interacting(self, label: Predicate) -> list[Predicate]:
        """Labels that say something more about what an existential's individuals are related to."""
        above = self._hierarchy.above(label.expression.prop)
        found = []
        for other in self.program.labels.values():
            expression = other.expression
            if other is label or not isinstance(expression, _RESTRICTIONS):
                continue
            shared = above & self._hierarchy.above(expression.prop)
            # Two existentials meet only in what both must be the one value of.
            if isinstance(expression, _EXISTENTIALS):
                shared = {prop for prop in shared if self._hierarchy.is_functional_as(prop)}
            if shared:
                found.append(other)
        return found

    def consequences(
        self, labels: tuple[Predicate, ...], make_up: bool = True
    ) -> set[Finding] | None:
        """What a member of all labels is, the labels included; None where there can be none."""
        engine = self._engine
        engine.restart([(label, _ROOT) for label in labels])
        if make_up and self.program.existentials:
            self._make_up()
        if not engine.consistent:
            return None
        root = engine.equality.find(_ROOT)
        classes = [*self.program.classes.values(), *self.program.labels.values()]
        found: set[Finding] = {predicate for predicate in classes if root in predicate.members}
        for predicate in self.program.objects.values():
            for turned, related in ((False, predicate.succ), (True, predicate.pred)):
                found.update(
                    (predicate, turned, other)
                    for other in related.get(root, ())
                    if not other.startswith((_ROOT, _MADE_UP))
                )
        for predicate in self.program.datas.values():
            found.update(
                (predicate, False, value)
                for value in predicate.succ.get(root, ())
                if not (isinstance(value, tuple) and value[0] == 'some')
            )
        return found

    def excludes(self, *props: tuple[str, bool], loop: bool = True) -> bool:
        """Whether the properties (IRI, turned) cannot all relate one individual to itself, or to
        another.
        """
        target = _ROOT if loop else _ROOT + '2'
        facts: list[Fact] = []
        for name, turned in props:
            pair = (target, _ROOT) if turned else (_ROOT, target)
            facts.append((self.program.object(name), *pair))
        self._engine.restart(facts)
        return not self._engine.consistent

    def _make_up(self) -> None:
        engine, numbers = self._engine, count()
        depth = {_ROOT: 0}
        done: set[tuple[int, str]] = set()
        progress = True
        while progress and engine.consistent and len(depth) < _MAX_MADE_UP:
            progress = False
            for place, existential in enumerate(self.program.existentials):
                for owner in tuple(existential.label.members):
                    level = depth.get(owner)
                    if level is None or level >= _MAX_DEPTH or (place, owner) in done:
                        continue
                    done.add((place, owner))
                    facts = self._witnesses(existential, owner, numbers, depth)
                    if facts:
                        progress = True
                        engine.supply(facts)

    def _witnesses(
        self, existential: Existential, owner: str, numbers: count[int], depth: dict[str, int]
    ) -> list[Fact]:
        prop = existential.prop
        n = min(existential.n, _MAX_COUNT)
        facts: list[Fact] = []
        if prop.kind == 'data':
            return [(prop, owner, ('some', existential.filler, next(numbers))) for _ in range(n)]
        filler = self._filled(existential)
        names = [f'{_MADE_UP}{next(numbers)}' for _ in range(n)]
        for name in names:
            depth[name] = depth[owner] + 1
            facts.append((prop, name, owner) if existential.inverse else (prop, owner, name))
            if filler is not None:
                facts.append((filler, name))
            facts += [(self.program.different, other, name) for other in names[: names.index(name)]]
            if self.program.uses_thing:
                facts.append((self.program.thing, name))
        return facts
