"""Answers that take reasoning by cases: what holds in every model (`search`).

One model shows what may follow: a fact that it lacks does not. What holds in it without a choice
follows; the rest is asked for one by one, by looking for a model without it. Every model that is
found on the way rules out further candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import combinations, permutations
from typing import TypeAlias

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axiom_text import axiom_text, expression_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import ClassExpression, Literal
from owl_reasoner.owl.vocabulary import NOTHING, THING, TOP, TOP_LITERAL, local_name
from owl_reasoner.reasoner.answers import Unknown
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import StoppedError, UnsupportedError, turned
from owl_reasoner.reasoner.datatypes import literal_of, value_of
from owl_reasoner.reasoner.hypertableau.clauses import ANYBODY, FRESH, CaseRules
from owl_reasoner.reasoner.hypertableau.model import Choices
from owl_reasoner.reasoner.hypertableau.search import CaseSearch
from owl_reasoner.reasoner.property_chains import AnyRole
from owl_reasoner.reasoner.translation import directed, inclusions
from owl_reasoner.reasoner.value_sets import point

MOST_STEPS = 1_000_000
"""Facts that may be added in all searches for one answer; some ten seconds."""
_QUESTION_STEPS = 200_000
"""The same for one axiom."""
_OTHER_MODELS = 4
"""Models that are asked for what they choose otherwise, before facts are asked for one by one."""
_UNSURE = ~0
"""All choices: those of a fact that a model only hints at, so that it is asked for."""
_MOST_KEPT = 200
"""Individuals in models of classes that stay while other classes are looked at."""
_A, _B = FRESH + 'someone', FRESH + 'another'
_Denial: TypeAlias = tuple[Axiom, ...]
_INCLUSIONS = (
    ax.SubObjectPropertyOf,
    ax.EquivalentObjectProperties,
    ax.InverseObjectProperties,
    ax.SymmetricObjectProperty,
)


class CaseReasoner:
    """Reasons by cases over axioms that stay as they are.

    Args:
        axioms: Everything that is asserted.
        most_steps: When to give up, in facts added.
        budget: What the whole reasoning may use.

    Attributes:
        gaps: One sentence for each axiom that is not fully used, or for what was not decided.
        class_gaps: What `hierarchy` did not decide.
        stopped: Whether a search was given up.
        names_individuals: Whether the axioms about classes name individuals.
    """

    def __init__(
        self,
        axioms: Iterable[Axiom],
        most_steps: int = MOST_STEPS,
        budget: Budget | None = None,
    ) -> None:
        axioms = list(axioms)
        self._budget = budget or Budget()
        self._budget.stage = 'reasoning by cases'
        self._rules = CaseRules(axioms, self._budget)
        self.gaps = dict(self._rules.gaps)
        self.class_gaps: dict[str, None] = {}
        self.stopped = False
        self._individuals = [
            a.iri for a in axioms if isinstance(a, ax.Declaration) and a.kind == 'individual'
        ]
        self._most_steps = most_steps
        self.names_individuals = bool(self._rules.nominals)
        # What makes concepts comes before the search.
        self._assertions = [self._prepared(a) for a in axioms if isinstance(a, ax.Assertion)]
        self._search = CaseSearch(self._rules, most_steps)
        self._base = self._search.mark()
        self._consistent: bool | None = None
        # Whether the search has the model that `consistent` found, and the steps it took.
        self._has_model, self._cost, self._settled = False, 0, 0
        # The steps from each state of what accepts a property's chains.
        self._automata: dict[str, dict[int, list[tuple[int | None, int]]]] = {}

    def _begin(self) -> None:
        """State everything that is asserted."""
        model = self._search.model
        for name in (*self._individuals, *self._rules.nominal_of):
            model.individual(name)
        if not self._individuals and not self._assertions:
            model.somebody()
        for assertion in self._assertions:
            self._state(*assertion)

    def _prepared(self, axiom: Axiom) -> tuple[Axiom, int]:
        """Return an assertion, a negative one as that of a class, and the concept it gives."""
        if isinstance(axiom, ax.NegativeObjectPropertyAssertion):
            other = ex.ObjectComplementOf(ex.ObjectOneOf((axiom.object,)))
            axiom = ax.ClassAssertion(ex.ObjectAllValuesFrom(axiom.prop, other), axiom.subject)
        elif isinstance(axiom, ax.NegativeDataPropertyAssertion):
            having = ex.DataHasValue(axiom.prop, axiom.literal)
            axiom = ax.ClassAssertion(ex.ObjectComplementOf(having), axiom.subject)
        if not isinstance(axiom, ax.ClassAssertion):
            return axiom, ANYBODY
        try:
            return axiom, self._rules.positive(axiom.cls)
        except UnsupportedError as reason:
            self.gaps[f'assertions of {expression_text(axiom.cls)}: {reason}'] = None
            return axiom, ANYBODY

    def _state(self, axiom: Axiom, concept: int) -> None:
        """State an assertion, whose concept is made."""
        model = self._search.model
        self._budget.tick()
        if isinstance(axiom, ax.ClassAssertion):
            model.concept(model.individual(axiom.individual)[0], concept, 0)
        elif isinstance(axiom, ax.ObjectPropertyAssertion):
            x, y = (model.individual(name)[0] for name in (axiom.subject, axiom.object))
            model.relate(x, self._rules.role(axiom.prop), y, 0)
        elif isinstance(axiom, ax.DataPropertyAssertion):
            x, _ = model.individual(axiom.subject)
            model.value(x, axiom.prop, point(value_of(axiom.literal)), 0)
        elif isinstance(axiom, ax.SameIndividual):
            first, *others = sorted(axiom.individuals)
            for other in others:
                model.same(model.individual(first)[0], model.individual(other)[0], 0)
        elif isinstance(axiom, ax.DifferentIndividuals):
            model.differ([model.individual(name)[0] for name in sorted(axiom.individuals)])

    # --- questions ---

    def consistent(self) -> bool:
        """Tell whether there is a model; True where that was not found out."""
        if self._consistent is None:
            try:
                found = self._search.attempt(self._begin) and self._search.settle()
            except StoppedError:
                self.stopped = self._consistent = True
                return True
            self._base = self._search.mark()
            before = self._search.model.steps
            self._consistent = self._has_model = found and self._is_possible(lambda: None)
            self._cost = self._search.model.steps - before
        return self._consistent

    def _is_possible(
        self, state: Callable[[], None], search: CaseSearch | None = None, settled: bool = False
    ) -> bool:
        """Tell whether what `state` says holds in some model, left in the tables.

        With `settled`, remember the state before the first choice and the steps that were taken.
        """
        search = search or self._search
        before = search.model.steps
        try:
            if not search.attempt(state):
                return False
            if settled:
                if not search.settle():
                    return False
                self._settled = search.mark()
            found = search.solve()
        except StoppedError:
            self.stopped = True
            return True
        if settled:
            self._cost = search.model.steps - before
        self.gaps.update(search.gaps)
        return found

    # --- everything that follows about individuals ---

    def facts(self, known: Callable[[Axiom], bool]) -> Iterator[Axiom]:
        """Return every fact about named individuals that follows and is not known."""
        search = self._search
        if not self.consistent():
            return
        if not self._has_model and not self._is_possible(lambda: None):
            return
        self._has_model = False
        if self.stopped:
            return
        candidates: dict[Axiom, None] = {}
        for fact, choices in self._held():
            if known(fact):
                continue
            if choices:
                candidates[fact] = None
            else:
                yield fact
        candidates = self._held_by_others(candidates, 1000 + 3 * self._cost)
        search.undo(self._base)
        while candidates and not self.stopped:
            fact = next(iter(candidates))
            del candidates[fact]
            self._budget.at_work = partial(axiom_text, fact)
            ((denial,),) = _denials(fact)
            if self._is_possible(partial(self._state, *self._prepared(denial))):
                held = {other for other, _ in self._held()}
                candidates = {other: None for other in candidates if other in held}
                search.undo(self._base)
            else:
                yield fact
                search.undo(self._base)
                self._keep(fact)

    def _held_by_others(self, candidates: dict[Axiom, None], most: int) -> dict[Axiom, None]:
        """Return those facts of the present model that models with other choices have as well.

        One such model often decides all that each fact would take a model for. It may be hard to
        find: then it is not looked for any longer.

        Args:
            candidates: Facts of the model.
            most: Steps for one model.
        """
        search = self._search
        try:
            for _ in range(_OTHER_MODELS):
                if not candidates:
                    break
                search.differ_from_model()
                search.undo(self._base)
                with search.model.at_most(most):
                    if not search.solve():
                        break
                self.gaps.update(search.gaps)
                held = {other for other, _ in self._held()}
                left = {other: None for other in candidates if other in held}
                is_of_use = len(left) < len(candidates)
                candidates = left
                if not is_of_use:
                    break
        except StoppedError:
            pass
        search.forget_models()
        return candidates

    def _keep(self, fact: Axiom) -> None:
        """Let further searches begin with a fact that follows."""
        stated = self._prepared(fact)
        try:
            self._search.attempt(lambda: self._state(*stated))
            self._search.settle()
        except StoppedError:
            self.stopped = True
        self._base = self._search.mark()

    def _held(self) -> Iterator[tuple[Axiom, Choices]]:
        """Return the facts of the last model, with the choices they depend on."""
        model = self._search.model
        for x in [x for x in model.alive() if model.names[x]]:
            for name in model.names[x]:
                _, owner = model.individual(name)
                for cls, choices in self._classes(x):
                    yield ax.ClassAssertion(cls, name), choices | owner
                for prop, literal, choices in self._literals(x):
                    yield ax.DataPropertyAssertion(prop, name, literal), choices | owner
                for other in model.names[x]:
                    if name < other:
                        pair = frozenset((name, other))
                        yield ax.SameIndividual(pair), owner | model.individual(other)[1]
                for prop, y, choices in self._relations(x):
                    for other in model.names[y]:
                        more = model.individual(other)[1]
                        yield ax.ObjectPropertyAssertion(prop, name, other), choices | owner | more

    def _classes(self, x: int) -> Iterator[tuple[str, Choices]]:
        for concept, choices in self._search.model.labels[x].items():
            cls = self._rules.names[concept]
            if cls and cls != THING:
                yield cls, choices

    def _literals(self, x: int) -> Iterator[tuple[str, Literal, Choices]]:
        """Return the values of an individual that are known: (property, literal, choices).

        Where a value differs from others that could be all but one of its set, each of the set may
        follow, and is asked for.
        """
        model = self._search.model
        there = model.values[x]
        for v in there:
            values, choices = model.sets[v]
            only = values.only
            for prop, more in model.props[v].items():
                if only is not None:
                    yield prop, literal_of(only), choices | more
                elif values.size <= len(there):
                    apart = sum(model.different(v, w) is not None for w in there if w != v)
                    if apart >= values.size - 1:
                        yield from ((prop, literal_of(one), _UNSURE) for one in values.members())

    def _relations(self, x: int) -> Iterator[tuple[str, int, Choices]]:
        """Return named individuals that one is related to: (property, individual, choices)."""
        model, rules = self._search.model, self._rules
        for y, roles in model.out[x].items():
            if model.names[y]:
                for role, choices in roles.items():
                    if role > 0 and not rules.is_complex(rules.role_names[role]):
                        yield rules.role_names[role], y, choices
        if model.out[x] or x in self._search.blocked:
            for prop in rules.complex_props():
                if prop != TOP:
                    yield from self._along(x, prop)

    def _along(self, x: int, prop: str) -> Iterator[tuple[str, int, Choices]]:
        """Follow a property that chains imply through the model.

        A blocked individual has the neighbours of the one in whose place it is, but not its parent:
        what is reached through these is asked for.
        """
        search, model = self._search, self._search.model
        steps = self._automata.get(prop)
        if steps is None:
            steps = self._automata[prop] = {}
            for before, step, after in self._rules.steps(prop):
                steps.setdefault(before, []).append((step, after))
        reached: dict[tuple[int, int], int] = {(x, 0): 0}
        pending = [(x, 0)]
        while pending:
            place = pending.pop()
            y, state = place
            choices = reached[place]
            if state == 1 and model.names[y]:
                yield prop, y, choices
            for step, after in steps.get(state, ()):
                if step is None:
                    following = [(y, 0)]
                else:
                    following = [
                        (z, roles[step] if one == y else _UNSURE)
                        for one in {y, search.blocked.get(y, y)}
                        for z, roles in model.out[one].items()
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
        if self._has_model:
            self._has_model = False
            self._search.undo(self._base)
        named = self.names_individuals
        left = self._most_steps - self._search.model.steps
        search = self._search if named else CaseSearch(self._rules, left)
        self.class_gaps = search.gaps
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

        What contradicts one model of the individuals is asked for again without it. Where there
        are no individuals, the first models stay: those that come may be like them.
        """
        apart = search is not self._search
        base = 0 if apart else self._base
        again: list[tuple[str, ...]] = []
        for model in (True, False):
            if model and self._is_possible(lambda: None, search):
                search.hold()
            start = search.mark()
            for question in questions if model else again:
                if self.stopped:
                    return
                self._budget.at_work = partial(_question_text, question)
                if not models.may_be(*question):
                    continue
                if self._is_possible(partial(models.state, *question), search, settled=True):
                    models.look(*question)
                    is_complete = self._look_at_other(question, models, search)
                    few = sum(1 for _ in search.model.alive()) < _MOST_KEPT
                    if apart and model and few and is_complete:
                        search.hold()
                        start = search.mark()
                elif search.depends:
                    again.append(question)
                else:
                    yield question
                search.undo(start)
            search.undo(base)

    def _look_at_other(
        self, question: tuple[str, ...], models: _ClassModels, search: CaseSearch
    ) -> bool:
        """Learn from a second model of a class, which chooses otherwise wherever it can.

        It rules out most of what the first one has by choice. Without it each of these classes
        takes a model of its own, which makes the comparison of n classes cost n * n models.

        Returns:
            Whether the search was left with a whole model.
        """
        if len(question) > 1 or self.stopped or not models.is_open(*question):
            return True
        search.differ_from_model()
        search.undo(self._settled)
        try:
            with search.model.at_most(1000 + 3 * self._cost):
                if not search.solve():
                    return False
        except StoppedError:
            return False
        finally:
            search.forget_models()
        models.look_at_all()
        return True


class _ClassModels:
    """What models of classes, one after the other, say of which class may be below which."""

    def __init__(self, rules: CaseRules, search: CaseSearch) -> None:
        self._rules, self._search, self._somebody = rules, search, 0
        self.certain: list[tuple[str, str]] = []
        # Sets of named classes as bits: thousands of sets of hundreds of classes are intersected.
        self._bits: dict[str, int] = {}
        self._common: dict[str, int] = {}
        self._above: dict[str, set[str]] = {}
        self._looked_at_all = False

    def state(self, cls: str, without: str = '') -> None:
        """State that somebody is in a class and not in another one."""
        model = self._search.model
        self._somebody = model.somebody()
        model.concept(self._somebody, self._rules.positive(cls), 0)
        if without:
            outside = self._rules.positive(ex.ObjectComplementOf(without))
            model.concept(self._somebody, outside, 0)

    def look(self, cls: str, without: str = '') -> None:
        """Learn from the model that was found."""
        self.look_at_all()
        if without:
            return
        rules, model = self._rules, self._search.model
        found, merged = model.find(self._somebody)
        labels = {} if found is None else model.labels[found]
        above = {rules.names[one]: choices | merged for one, choices in labels.items()}
        self.certain += [
            (cls, sup) for sup, choices in above.items() if not choices and sup not in ('', cls)
        ]
        self._above[cls] = {sup for sup, choices in above.items() if choices} - {'', cls}

    def look_at_all(self) -> None:
        """Learn from everybody in the model: who is in a class is in all that is above it.

        Individuals that were there before the question are looked at once: later they are the
        same, or have more classes.
        """
        asked, _ = self._search.model.find(self._somebody)
        names, model, blocked = self._rules.names, self._search.model, self._search.blocked
        bits, common = self._bits, self._common
        for y in model.alive():
            is_old = y < self._somebody and y != asked
            if y in blocked or (is_old and self._looked_at_all):
                continue
            there = [name for concept in model.labels[y] if (name := names[concept])]
            mask = 0
            for name in there:
                bit = bits.get(name)
                if bit is None:
                    bit = bits[name] = 1 << len(bits)
                mask |= bit
            for name in (THING, *there):
                common[name] = common.get(name, mask) & mask
        self._looked_at_all = True

    def may_be(self, cls: str, sup: str = '') -> bool:
        """Tell whether every member of the class was a member of the other one so far."""
        return not sup or bool(self._common[cls] & self._bits[sup])

    def is_open(self, cls: str) -> bool:
        """Tell whether the class may be below another one that its model chose."""
        common, bits = self._common[cls], self._bits
        return any(common & bits[sup] for sup in self._above[cls])

    def possible(self) -> list[tuple[str, str]]:
        """Return the pairs of classes, one above the other in the class's model by choice."""
        return [
            (cls, sup)
            for cls, above in self._above.items()
            for sup in sorted(above)
            if self.may_be(cls, sup)
        ]


def _question_text(question: tuple[str, ...]) -> str:
    return 'the question ' + ' below '.join(map(local_name, question))


# --- what must hold where an axiom does not ---


def _denials(goal: Axiom) -> Iterator[_Denial]:
    """Yield sets of assertions, all of one of which hold where an axiom does not.

    Raises:
        UnsupportedError: The axiom is a key, a rule or a datatype definition, or compares data
            properties.
    """
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


def _property_denials(goal: Axiom) -> Iterator[_Denial]:
    if isinstance(goal, _INCLUSIONS):
        for sub, sup in inclusions(goal):
            yield _holds(sub), _fails(sup)
    elif isinstance(goal, ax.AsymmetricObjectProperty):
        role = directed(goal.prop)
        yield _holds(role), _holds(turned(role))
    elif isinstance(goal, ax.TransitiveObjectProperty):
        yield from _property_denials(ax.SubPropertyChainOf((goal.prop, goal.prop), goal.prop))
    elif isinstance(goal, ax.SubPropertyChainOf):
        places = [f'{_A}{place}' for place in range(len(goal.chain) + 1)]
        steps = zip(map(directed, goal.chain), places, places[1:], strict=False)
        links = (_holds(role, one, other) for role, one, other in steps)
        yield (*links, _fails(directed(goal.sup), places[0], places[-1]))
    elif isinstance(goal, ax.DisjointObjectProperties):
        for one, other in ax.pairs_of(goal.props):
            yield _holds(directed(one)), _holds(directed(other))
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


def _holds(role: AnyRole, one: str = _A, other: str = _B) -> Axiom:
    iri, inverted = role
    pair = (other, one) if inverted else (one, other)
    return ax.ObjectPropertyAssertion(iri, *pair)


def _fails(role: AnyRole, one: str = _A, other: str = _B) -> Axiom:
    iri, inverted = role
    pair = (other, one) if inverted else (one, other)
    return ax.NegativeObjectPropertyAssertion(iri, *pair)


def entails(
    axioms: Iterable[Axiom], goal: Axiom | None, budget: Budget | None = None
) -> bool | Unknown:
    """Tell whether an axiom (None: a contradiction) follows: its denial contradicts the others.

    Returns:
        Unknown where some axioms are not covered, or the search was given up, and no contradiction
        was found.

    Raises:
        UnsupportedError: The goal is a key, a rule, a datatype definition or about anonymous
            individuals, or compares data properties.
    """
    if '_:' in repr(goal):
        raise UnsupportedError('an axiom about anonymous individuals')
    axioms = list(axioms)
    against: list[_Denial] = [()] if goal is None else list(_denials(goal))
    because: dict[str, None] = {}
    for denial in against:
        reasoner = CaseReasoner([*axioms, *denial], _QUESTION_STEPS, budget)
        if reasoner.consistent():
            if not reasoner.gaps and not reasoner.stopped:
                return False
            because.update(reasoner.gaps)
            if reasoner.stopped:
                because['reasoning by cases took too many steps'] = None
    return Unknown((*because,)) if because else True
