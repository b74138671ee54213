"""Answers that take reasoning by cases: what holds in every model (`case_search`).

One model shows what may follow: a fact that it lacks does not. What holds in it without a choice
follows; the rest is asked for one by one, by looking for a model without it. Every model that is
found on the way rules out further candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import combinations, permutations

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import ClassExpression, PropertyExpression
from surveillance_ontology.owl.vocabulary import NOTHING, THING, TOP_LITERAL
from surveillance_ontology.reasoner.case_rules import FRESH, TOP, CaseRules
from surveillance_ontology.reasoner.case_search import CaseSearch
from surveillance_ontology.reasoner.clauses import StoppedError, UnsupportedError
from surveillance_ontology.reasoner.datatypes import literal_of, value_of

_NEGATIVE = (ax.NegativeObjectPropertyAssertion, ax.NegativeDataPropertyAssertion)
MOST_STEPS = 1_000_000
"""Facts that may be added in all searches for one answer; some ten seconds."""
_QUESTION_STEPS = 200_000
"""The same for one axiom."""


class CaseReasoner:
    """Reasons by cases over axioms that stay as they are.

    Args:
        axioms: Everything that is asserted.
        most_steps: When to give up, in facts added.

    Attributes:
        gaps: One sentence for each axiom that is not fully used, or for what was not decided.
        stopped: Whether a search was given up.
        names_individuals: Whether the axioms about classes name individuals.
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
        self.names_individuals = bool(self._rules.nominals)
        self._stated: list[tuple[Axiom, int]] = []
        for axiom in self._assertions:
            self._translate(axiom)
        self._search = CaseSearch(self._rules, self._left)
        self._possible = self._search.attempt(self._state)
        self._base = self._search.mark()
        self._consistent: bool | None = None

    def _translate(self, axiom: Axiom) -> None:
        """Make the concept of an assertion that needs one."""
        if isinstance(axiom, ax.ClassAssertion):
            expression: ClassExpression = axiom.cls
        elif isinstance(axiom, _NEGATIVE):
            expression = _without(axiom)
        else:
            return
        self._stated.append((axiom, self._concept(expression)))

    def _concept(self, expression: ClassExpression) -> int:
        try:
            return self._rules.positive(expression)
        except UnsupportedError as reason:
            self.gaps[f'an assertion: {reason}'] = None
            return 0

    def _state(self) -> None:
        search = self._search
        for name in (*self._individuals, *self._rules.nominal_of):
            search.individual(name)
        if not self._individuals and not self._assertions:
            search.somebody()
        concepts = dict(self._stated)
        for axiom in self._assertions:
            self._state_one(axiom, concepts.get(axiom))

    def _state_one(self, axiom: Axiom, concept: int | None = None) -> None:
        """State an assertion; `concept` is what it says of its individual, where it has one."""
        search = self._search
        if concept is not None:
            name = axiom.individual if isinstance(axiom, ax.ClassAssertion) else axiom.subject  # type: ignore[attr-defined]
            search.concept(search.individual(name), concept, 0)
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
        """Tell whether there is a model; True where that was not found out."""
        if self._consistent is None:
            found = self._possible and self._search.settle()
            self._base = self._search.mark()
            self._consistent = found and self._is_possible(lambda: None)
            self._search.undo(self._base)
        return self._consistent

    def _is_possible(self, state: Callable[[], None], search: CaseSearch | None = None) -> bool:
        """Tell whether what `state` says holds in some model, left in the tables."""
        search = search or self._search
        try:
            if not search.attempt(state):
                return False
            found = search.solve()
        except StoppedError:
            self.stopped = True
            return True
        self.gaps.update(search.gaps)
        return found

    def _denial(self, axiom: Axiom) -> Callable[[], None] | None:
        """Return what to state to deny a fact of the model; None where it has no concept."""
        search = self._search
        if isinstance(axiom, ax.ClassAssertion):
            name, concept = axiom.individual, self._concept(ex.ObjectComplementOf(axiom.cls))
        elif isinstance(axiom, ax.ObjectPropertyAssertion | ax.DataPropertyAssertion):
            name, concept = axiom.subject, self._concept(_without(axiom))
        elif isinstance(axiom, ax.SameIndividual):
            return lambda: search.differ(map(search.individual, axiom.individuals))
        else:
            return None
        return (lambda: search.concept(search.individual(name), concept, 0)) if concept else None

    # --- everything that follows about individuals ---

    def facts(self, known: Callable[[Axiom], bool]) -> Iterator[Axiom]:
        """Return every fact about named individuals that follows and is not known."""
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
                search.undo(self._base)
            else:
                yield fact
                search.undo(self._base)
                self._keep(fact)

    def _keep(self, fact: Axiom) -> None:
        """Let further searches begin with a fact that follows."""
        concept = self._concept(fact.cls) if isinstance(fact, ax.ClassAssertion) else None
        try:
            self._search.attempt(lambda: self._state_one(fact, concept))
            self._search.settle()
        except StoppedError:
            self.stopped = True
        self._base = self._search.mark()

    def _held(self) -> Iterator[tuple[Axiom, int]]:
        """Return the facts of the last model, with the choices they depend on."""
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
        """Return named individuals that one is related to: (property, individual, choices)."""
        search, rules = self._search, self._rules
        for y, roles in search.out[x].items():
            if search.names[y]:
                for role, choices in roles.items():
                    if role > 0 and not rules.is_complex(rules.role_names[role]):
                        yield rules.role_names[role], y, choices
        for prop in rules.role_names[1:]:
            if prop != TOP and rules.is_complex(prop):
                yield from self._along(x, prop)

    def _along(self, x: int, prop: str) -> Iterator[tuple[str, int, int]]:
        """Follow a property that chains imply through the model."""
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
        """Return the pairs of named classes, one below the other, that follow and are not known.

        A class that can have no members is below owl:Nothing.
        """
        if not self.consistent():
            return
        named = self.names_individuals
        search = self._search if named else CaseSearch(self._rules, self._left)
        models = _ClassModels(self._rules, search)
        wanted = [(cls,) for cls in classes if not known(cls, NOTHING)]
        for cls, *_ in self._impossible(wanted, models, search):
            yield cls, NOTHING
        for cls, sup in models.certain:
            if not known(cls, sup):
                yield cls, sup
        pairs = [pair for pair in models.possible() if not known(*pair)]
        for cls, *rest in self._impossible(pairs, models, search):
            yield cls, rest[0]

    def _impossible(
        self, questions: Iterable[tuple[str, ...]], models: _ClassModels, search: CaseSearch
    ) -> Iterator[tuple[str, ...]]:
        """Yield the classes, alone or without another, that can have no members.

        What contradicts one model of the individuals is asked for again without it.
        """
        base = self._base if search is self._search else 0
        again: list[tuple[str, ...]] = []
        for model in (True, False):
            if model and self._is_possible(lambda: None, search):
                search.hold()
            start = search.mark()
            for question in questions if model else again:
                if self.stopped:
                    return
                if not models.may_be(*question):
                    continue
                if self._is_possible(partial(models.state, *question), search):
                    models.look(*question)
                elif search.depends:
                    again.append(question)
                else:
                    yield question
                search.undo(start)
            search.undo(base)


class _ClassModels:
    """What models of classes, one after the other, say of which class may be below which."""

    def __init__(self, rules: CaseRules, search: CaseSearch) -> None:
        self._rules, self._search, self._somebody = rules, search, 0
        self.certain: list[tuple[str, str]] = []
        self._common: dict[str, set[str]] = {}
        self._above: dict[str, set[str]] = {}

    def state(self, cls: str, without: str = '') -> None:
        """State that somebody is in a class and not in another one."""
        self._somebody = self._search.somebody()
        if cls != THING:
            self._search.concept(self._somebody, self._rules.concept(cls), 0)
        if without:
            outside = self._rules.positive(ex.ObjectComplementOf(without))
            self._search.concept(self._somebody, outside, 0)

    def look(self, cls: str, without: str = '') -> None:
        """Learn from the model that was found."""
        rules, search = self._rules, self._search
        for y in search.alive():
            names = {rules.names[concept] for concept in search.labels[y]} - {''}
            for name in (THING, *names):
                shared = self._common.get(name)
                self._common[name] = names if shared is None else shared & names
        if without:
            return
        found, merged = search.find(self._somebody)
        labels = {} if found is None else search.labels[found]
        above = {rules.names[one]: choices | merged for one, choices in labels.items()}
        self.certain += [
            (cls, sup) for sup, choices in above.items() if not choices and sup not in ('', cls)
        ]
        self._above[cls] = {sup for sup, choices in above.items() if choices} - {'', cls}

    def may_be(self, cls: str, sup: str = '') -> bool:
        """Tell whether every member of the class was a member of the other one so far."""
        return not sup or sup in self._common[cls]

    def possible(self) -> list[tuple[str, str]]:
        """Return the pairs of classes, one above the other in the class's model by choice."""
        return [(cls, sup) for cls, above in self._above.items() for sup in sorted(above)]


def _without(axiom: Axiom) -> ClassExpression:
    """Return the class of what an individual would be without a property assertion."""
    if isinstance(axiom, ax.ObjectPropertyAssertion | ax.NegativeObjectPropertyAssertion):
        other = ex.ObjectComplementOf(ex.ObjectOneOf((axiom.object,)))
        return ex.ObjectAllValuesFrom(axiom.prop, other)
    assert isinstance(axiom, ax.DataPropertyAssertion | ax.NegativeDataPropertyAssertion)
    return ex.ObjectComplementOf(ex.DataHasValue(axiom.prop, axiom.literal))


# --- any axiom ---


def entails(axioms: Iterable[Axiom], goal: Axiom | None) -> bool | None:
    """Tell whether an axiom (None: a contradiction) follows: its denial contradicts the others.

    Returns:
        None where some axioms are not covered, or the search was given up, and no contradiction was
        found.

    Raises:
        UnsupportedError: The goal is a key, a rule, a datatype definition or about anonymous
            individuals, or compares data properties.
    """
    axioms = list(axioms)
    denials: list[Denial] = [()] if goal is None else list(_denials(goal))
    certain = True
    for denial in denials:
        reasoner = CaseReasoner([*axioms, *denial], _QUESTION_STEPS)
        if reasoner.consistent():
            if not reasoner.gaps and not reasoner.stopped:
                return False
            certain = False
    return True if certain else None


_A, _B = FRESH + 'someone', FRESH + 'another'
Denial = tuple[Axiom, ...]


def _denials(goal: Axiom) -> Iterator[Denial]:
    """Return assertions one of which must hold where an axiom does not."""
    if '_:' in repr(goal):
        raise UnsupportedError('an axiom about anonymous individuals')
    if isinstance(goal, ax.SubClassOf):
        yield (_member(goal.sub, ex.ObjectComplementOf(goal.sup)),)
    elif isinstance(goal, ax.EquivalentClasses):
        for sub, sup in permutations(goal.classes, 2):
            yield (_member(sub, ex.ObjectComplementOf(sup)),)
    elif isinstance(goal, ax.DisjointClasses):
        yield from ((_member(*pair),) for pair in ax.pairs_of(goal.classes))
    elif isinstance(goal, ax.DisjointUnion):
        whole, parts = goal.cls, ex.ObjectUnionOf(goal.classes)
        yield from _denials(ax.EquivalentClasses((whole, parts)))
        yield from _denials(ax.DisjointClasses(goal.classes))
    elif isinstance(goal, ax.ClassAssertion):
        yield (ax.ClassAssertion(ex.ObjectComplementOf(goal.cls), goal.individual),)
    elif isinstance(goal, ax.SameIndividual):
        for pair in combinations(sorted(goal.individuals), 2):
            yield (ax.DifferentIndividuals(frozenset(pair)),)
    elif isinstance(goal, ax.DifferentIndividuals):
        for pair in combinations(sorted(goal.individuals), 2):
            yield (ax.SameIndividual(frozenset(pair)),)
    elif isinstance(goal, ax.ObjectPropertyAssertion):
        yield (ax.NegativeObjectPropertyAssertion(goal.prop, goal.subject, goal.object),)
    elif isinstance(goal, ax.NegativeObjectPropertyAssertion):
        yield (ax.ObjectPropertyAssertion(goal.prop, goal.subject, goal.object),)
    elif isinstance(goal, ax.DataPropertyAssertion):
        yield (ax.NegativeDataPropertyAssertion(goal.prop, goal.subject, goal.literal),)
    elif isinstance(goal, ax.NegativeDataPropertyAssertion):
        yield (ax.DataPropertyAssertion(goal.prop, goal.subject, goal.literal),)
    else:
        yield from _property_denials(goal)


def _property_denials(goal: Axiom) -> Iterator[Denial]:
    if isinstance(goal, ax.SubObjectPropertyOf):
        yield _holds(goal.sub), _fails(goal.sup)
    elif isinstance(goal, ax.EquivalentObjectProperties):
        for sub, sup in permutations(goal.props, 2):
            yield _holds(sub), _fails(sup)
    elif isinstance(goal, ax.InverseObjectProperties):
        yield _holds(goal.first), _fails(goal.second, _B, _A)
        yield _holds(goal.second), _fails(goal.first, _B, _A)
    elif isinstance(goal, ax.SymmetricObjectProperty):
        yield _holds(goal.prop), _fails(goal.prop, _B, _A)
    elif isinstance(goal, ax.AsymmetricObjectProperty):
        yield _holds(goal.prop), _holds(goal.prop, _B, _A)
    elif isinstance(goal, ax.TransitiveObjectProperty):
        yield from _property_denials(ax.SubPropertyChainOf((goal.prop, goal.prop), goal.prop))
    elif isinstance(goal, ax.SubPropertyChainOf):
        places = [f'{_A}{place}' for place in range(len(goal.chain) + 1)]
        steps = zip(goal.chain, places, places[1:], strict=False)
        links = (_holds(prop, one, other) for prop, one, other in steps)
        yield (*links, _fails(goal.sup, places[0], places[-1]))
    elif isinstance(goal, ax.DisjointObjectProperties):
        for one, other in ax.pairs_of(goal.props):
            yield _holds(one), _holds(other)
    elif isinstance(goal, ax.FunctionalObjectProperty):
        yield (_member(ex.ObjectMinCardinality(2, goal.prop)),)
    elif isinstance(goal, ax.InverseFunctionalObjectProperty):
        prop = goal.prop
        back = ex.ObjectInverseOf(prop) if isinstance(prop, str) else prop.prop
        yield (_member(ex.ObjectMinCardinality(2, back)),)
    elif isinstance(goal, ax.ReflexiveObjectProperty):
        yield (_member(ex.ObjectComplementOf(ex.ObjectHasSelf(goal.prop))),)
    elif isinstance(goal, ax.IrreflexiveObjectProperty):
        yield (_member(ex.ObjectHasSelf(goal.prop)),)
    elif isinstance(goal, ax.ObjectPropertyDomain):
        some = ex.ObjectSomeValuesFrom(goal.prop, THING)
        yield (_member(some, ex.ObjectComplementOf(goal.domain)),)
    elif isinstance(goal, ax.ObjectPropertyRange):
        yield (_member(ex.ObjectSomeValuesFrom(goal.prop, ex.ObjectComplementOf(goal.range))),)
    elif isinstance(goal, ax.FunctionalDataProperty):
        yield (_member(ex.DataMinCardinality(2, goal.prop)),)
    elif isinstance(goal, ax.DataPropertyDomain):
        value = ex.DataSomeValuesFrom(goal.prop, TOP_LITERAL)
        yield (_member(value, ex.ObjectComplementOf(goal.domain)),)
    elif isinstance(goal, ax.DataPropertyRange):
        outside = ex.DataComplementOf(goal.range)
        yield (_member(ex.DataSomeValuesFrom(goal.prop, outside)),)
    else:
        raise UnsupportedError(f'an axiom of the kind {type(goal).__name__}')


def _member(*classes: ClassExpression) -> ax.ClassAssertion:
    """Somebody is in all classes."""
    cls = classes[0] if len(classes) == 1 else ex.ObjectIntersectionOf(classes)
    return ax.ClassAssertion(cls, _A)


def _holds(prop: PropertyExpression, one: str = _A, other: str = _B) -> Axiom:
    if isinstance(prop, str):
        return ax.ObjectPropertyAssertion(prop, one, other)
    return ax.ObjectPropertyAssertion(prop.prop, other, one)


def _fails(prop: PropertyExpression, one: str = _A, other: str = _B) -> Axiom:
    if isinstance(prop, str):
        return ax.NegativeObjectPropertyAssertion(prop, one, other)
    return ax.NegativeObjectPropertyAssertion(prop.prop, other, one)
