"""Answers that take reasoning by cases: what holds in every model (`case_search`).

One model shows what may follow: a fact that it lacks does not. What holds in it without a choice
follows; the rest is asked for one by one, by looking for a model without it. Every model that is
found on the way rules out further candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import ClassExpression
from surveillance_ontology.owl.vocabulary import NOTHING, THING
from surveillance_ontology.reasoner.case_rules import CaseRules, NotCoveredError
from surveillance_ontology.reasoner.case_search import CaseSearch, StoppedError
from surveillance_ontology.reasoner.datatypes import Value, literal_of, value_of
from surveillance_ontology.reasoner.value_sets import point

MOST_STEPS = 400_000
"""Facts that may be added in all searches for one answer; some seconds."""


class CaseReasoner:
    """Reasons by cases over axioms that stay as they are.

    Args:
        axioms: Everything that is asserted.
        most_steps: When to give up, in facts added.

    Attributes:
        gaps: One sentence for each axiom that is not fully used, or for what was not decided.
        stopped: Whether a search was given up.
    """

    def __init__(self, axioms: Iterable[Axiom], most_steps: int = MOST_STEPS) -> None:
        axioms = list(axioms)
        self._rules = CaseRules(axioms)
        self.gaps = dict(self._rules.gaps)
        self.stopped = False
        self._assertions = [axiom for axiom in axioms if isinstance(axiom, ax.Assertion)]
        self._individuals = [
            a.iri for a in axioms if isinstance(a, ax.Declaration) and a.kind == 'individual'
        ]
        self._left = most_steps
        self._names_individuals = bool(self._rules.nominals)
        self._stated: list[tuple[Axiom, int]] = []
        for axiom in self._assertions:
            self._translate(axiom)
        self._search = CaseSearch(self._rules, self._left)
        self._possible = self._search.attempt(self._state)
        self._base = self._search.mark()
        self._consistent: bool | None = None

    def _translate(self, axiom: Axiom) -> None:
        """Makes the concept of an assertion that needs one."""
        if isinstance(axiom, ax.ClassAssertion):
            expression: ClassExpression = axiom.cls
        elif isinstance(axiom, ax.NegativeObjectPropertyAssertion | ax.NegativeDataPropertyAssertion):
            expression = _without(axiom)
        else:
            return
        self._stated.append((axiom, self._concept(expression)))

    def _concept(self, expression: ClassExpression) -> int:
        try:
            return self._rules.positive(expression)
        except NotCoveredError as reason:
            self.gaps[f'an assertion: {reason}'] = None
            return 0

    def _state(self) -> None:
        search = self._search
        for name in self._individuals:
            search.individual(name)
        if not self._individuals and not self._assertions:
            search.somebody()
        concepts = dict(self._stated)
        for axiom in self._assertions:
            if axiom in concepts:
                name = axiom.individual if isinstance(axiom, ax.ClassAssertion) else axiom.subject  # type: ignore[attr-defined]
                search.concept(search.individual(name), concepts[axiom], 0)
            elif isinstance(axiom, ax.ObjectPropertyAssertion):
                pair = search.individual(axiom.subject), search.individual(axiom.object)
                search.relate(pair[0], self._rules.role(axiom.prop), pair[1], 0)
            elif isinstance(axiom, ax.DataPropertyAssertion):
                value = value_of(axiom.literal)
                search.state_value(search.individual(axiom.subject), axiom.prop, value)
            elif isinstance(axiom, ax.SameIndividual):
                first, *others = sorted(axiom.individuals)
                for other in others:
                    search.same(search.individual(first), search.individual(other))
            elif isinstance(axiom, ax.DifferentIndividuals):
                search.differ([search.individual(name) for name in sorted(axiom.individuals)])

    # --- questions ---

    def consistent(self) -> bool:
        """Whether there is a model; True where that was not found out."""
        if self._consistent is None:
            found = self._possible and self._search.settle()
            self._base = self._search.mark()
            self._consistent = found and self._is_possible(lambda: None)
            self._search.undo(self._base)
        return self._consistent

    def _is_possible(self, state: Callable[[], None]) -> bool:
        """Whether there is a model in which what `state` says holds; it is left in the tables."""
        search = self._search
        try:
            if not search.attempt(state):
                return False
            found = search.solve()
        except StoppedError:
            self.stopped = True
            return True
        self.gaps.update(search.gaps)
        return found

    def entails(self, axiom: Axiom) -> bool:
        """Whether a fact follows from consistent axioms."""
        search = self._search
        if not self.consistent():
            return False
        state = self._denial(axiom)
        if state is None:
            return False
        search.undo(self._base)
        found = not self._is_possible(state)
        search.undo(self._base)
        return found

    def _denial(self, axiom: Axiom) -> Callable[[], None] | None:
        """What to state for a fact to be false; None for a fact that cannot be asked for."""
        search = self._search
        if isinstance(axiom, ax.SubClassOf):
            both = ex.ObjectIntersectionOf((axiom.sub, ex.ObjectComplementOf(axiom.sup)))
            concept = self._concept(both)
            return (lambda: search.concept(search.somebody(), concept, 0)) if concept else None
        if isinstance(axiom, ax.ClassAssertion):
            name, concept = axiom.individual, self._concept(ex.ObjectComplementOf(axiom.cls))
        elif isinstance(axiom, ax.ObjectPropertyAssertion | ax.DataPropertyAssertion):
            name, concept = axiom.subject, self._concept(_without(axiom))
        elif isinstance(axiom, ax.SameIndividual) and len(axiom.individuals) == 2:
            return lambda: search.differ(map(search.individual, axiom.individuals))
        elif isinstance(axiom, ax.DifferentIndividuals) and len(axiom.individuals) == 2:
            return lambda: search.same(*map(search.individual, axiom.individuals))
        else:
            return None
        return (lambda: search.concept(search.individual(name), concept, 0)) if concept else None

    # --- everything that follows about individuals ---

    def facts(self, known: Callable[[Axiom], bool]) -> Iterator[Axiom]:
        """Every fact about named individuals that follows and is not known."""
        search = self._search
        if not self.consistent():
            return
        if not self._is_possible(lambda: None) or self.stopped:
            return
        candidates: dict[Axiom, None] = {}
        for fact, choices in self._held():
            if known(fact):
                continue
            if choices:
                candidates[fact] = None
            else:
                yield fact
        search.undo(self._base)
        while candidates and not self.stopped:
            fact = next(iter(candidates))
            del candidates[fact]
            state = self._denial(fact)
            if state is None:
                continue
            if self._is_possible(state):
                held = {other for other, _ in self._held()}
                candidates = {other: None for other in candidates if other in held}
            else:
                yield fact
            search.undo(self._base)

    def _held(self) -> Iterator[tuple[Axiom, int]]:
        """The facts of the model, with the choices they depend on."""
        search, rules = self._search, self._rules
        named = [x for x in search.alive() if search.names[x]]
        for x in named:
            for name in search.names[x]:
                owner = search.choices_of(name)
                for concept, choices in search.labels[x].items():
                    cls = rules.names[concept]
                    if cls and cls != THING:
                        yield ax.ClassAssertion(cls, name), choices | owner
                for fact, choices in self._values_of(x, name):
                    yield fact, choices | owner
                for other in search.names[x]:
                    if name < other:
                        pair = frozenset((name, other))
                        yield ax.SameIndividual(pair), owner | search.choices_of(other)
                for prop, y, choices in self._relations(x):
                    for other in search.names[y]:
                        more = search.choices_of(other)
                        yield ax.ObjectPropertyAssertion(prop, name, other), choices | owner | more

    def _values_of(self, x: int, name: str) -> Iterator[tuple[Axiom, int]]:
        search = self._search
        for v in search.values[x]:
            values, choices = search.value_sets[v]
            only = values.only
            if only is not None:
                for prop, more in search.value_props[v].items():
                    fact = ax.DataPropertyAssertion(prop, name, literal_of(only))
                    yield fact, choices | more

    def _relations(self, x: int) -> Iterator[tuple[str, int, int]]:
        """Named individuals that one is related to: (property, individual, choices)."""
        search, rules = self._search, self._rules
        for y, roles in search.out[x].items():
            if search.names[y]:
                for role, choices in roles.items():
                    if role > 0 and not rules.is_complex(rules.role_names[role]):
                        yield rules.role_names[role], y, choices
        for prop in rules.role_names[1:]:
            if rules.is_complex(prop):
                yield from self._along(x, prop)

    def _along(self, x: int, prop: str) -> Iterator[tuple[str, int, int]]:
        """Follows a property that chains imply through the model."""
        search = self._search
        steps: dict[int, list[tuple[int | None, int]]] = {}
        for before, step, after in self._rules.steps(prop):
            steps.setdefault(before, []).append((step, after))
        reached: dict[tuple[int, int], int] = {(x, 0): 0}
        pending = [(x, 0)]
        while pending:
            place = pending.pop()
            y, state = place
            choices = reached[place]
            if state == 1 and search.names[y]:
                yield prop, y, choices
            for step, after in steps.get(state, ()):
                if step is None:
                    following = [(y, 0)]
                else:
                    following = [
                        (z, roles[step])
                        for one in {y, search.blocked.get(y, y)}
                        for z, roles in search.out[one].items()
                        if step in roles
                    ]
                for z, more in following:
                    if (z, after) not in reached:
                        reached[z, after] = choices | more
                        pending.append((z, after))

    # --- the class hierarchy ---

    def hierarchy(
        self, classes: Iterable[str], known: Callable[[str, str], bool]
    ) -> Iterator[tuple[str, str]]:
        """Every pair of named classes, the first below the second, that follows and is not known.

        A class that can have no members is below owl:Nothing.
        """
        if not self.consistent():
            return
        rules = self._rules
        search = self._search if self._names_individuals else CaseSearch(rules, self._left)
        base = self._base if search is self._search else search.mark()
        possible: dict[str, set[str]] = {}
        known_models: dict[str, set[str]] = {}

        def asked(concepts: Iterable[int]) -> bool:
            def state() -> None:
                x = search.somebody()
                self._somebody = x
                for concept in concepts:
                    search.concept(x, concept, 0)

            try:
                if not (search.attempt(state) and search.solve()):
                    return False
            except StoppedError:
                self.stopped = True
                return True
            self.gaps.update(search.gaps)
            for y in search.alive():
                names = {rules.names[concept] for concept in search.labels[y]} - {''}
                for name in names:
                    shared = known_models.get(name)
                    known_models[name] = names if shared is None else shared & names
            return True

        for cls in classes:
            if known(cls, NOTHING) or self.stopped:
                continue
            if not asked([rules.concept(cls)]):
                yield cls, NOTHING
            elif not self.stopped:
                found, merged = search.find(self._somebody)
                labels = {} if found is None else search.labels[found]
                certain = {
                    rules.names[one] for one, choices in labels.items() if not choices | merged
                }
                possible[cls] = {rules.names[one] for one in labels} - certain - {'', cls}
                for sup in certain - {'', cls}:
                    if not known(cls, sup):
                        yield cls, sup
            search.undo(base)
        for cls, above in possible.items():
            for sup in sorted(above):
                if sup not in known_models[cls] or known(cls, sup) or self.stopped:
                    continue
                no = rules.positive(ex.ObjectComplementOf(sup))
                if not asked([rules.concept(cls), no]):
                    yield cls, sup
                search.undo(base)


def _without(axiom: Axiom) -> ClassExpression:
    """The class of what an individual would be without a property assertion."""
    if isinstance(axiom, ax.ObjectPropertyAssertion | ax.NegativeObjectPropertyAssertion):
        other = ex.ObjectComplementOf(ex.ObjectOneOf((axiom.object,)))
        return ex.ObjectAllValuesFrom(axiom.prop, other)
    assert isinstance(axiom, ax.DataPropertyAssertion | ax.NegativeDataPropertyAssertion)
    return ex.ObjectComplementOf(ex.DataHasValue(axiom.prop, axiom.literal))
