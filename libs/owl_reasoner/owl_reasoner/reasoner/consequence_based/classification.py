"""The part of an ontology that is not about individuals: its program, completed, and the hierarchy
of its classes.

What a class implies through individuals that must exist, but are not known, is found in its context
(`contexts`) and added to the program as clauses. Where several restrictions act together, what
follows is left to reasoning by cases.
"""

from __future__ import annotations

from collections.abc import Iterable

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import (
    ClassExpression,
    DataMinCardinality,
    DataSomeValuesFrom,
    ObjectMinCardinality,
    ObjectSomeValuesFrom,
)
from owl_reasoner.owl.vocabulary import NOTHING, THING
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import (
    AtMost,
    BodyAtom,
    Clause,
    Constant,
    Existential,
    HeadAtom,
    Predicate,
    PredicateAtom,
    RangeAtom,
    Term,
    closure,
    turned,
)
from owl_reasoner.reasoner.consequence_based.contexts import Context, Contexts
from owl_reasoner.reasoner.consequence_based.rule_index import Role, Token, Tokens
from owl_reasoner.reasoner.inclusions import directed
from owl_reasoner.reasoner.property_chains import report_counted_chains, spell_out_chains
from owl_reasoner.reasoner.simplify import drop_implied_atoms, simplify
from owl_reasoner.reasoner.translation import Translation
from owl_reasoner.reasoner.value_sets import ValueSet

_X, _Y = 0, 1


class Classification:
    """Builds the program and the hierarchy of named classes.

    Args:
        axioms: The ontology's axioms; of its assertions only the complex classes matter.
        asserted: Complex class expressions that individuals are asserted to belong to.
        negated: Properties with negative assertions, as pairs (kind, IRI).
        budget: What it may use.

    Attributes:
        program: To be run by one `Engine`.
        within: For classes of one individual at most, the individual's names.
    """

    def __init__(
        self,
        axioms: Iterable[Axiom],
        asserted: Iterable[ClassExpression] = (),
        negated: Iterable[tuple[str, str]] = (),
        budget: Budget | None = None,
    ) -> None:
        self._budget = budget or Budget()
        tbox = [axiom for axiom in axioms if not isinstance(axiom, ax.Assertion)]
        asserted, negated = tuple(asserted), tuple(negated)
        translation = Translation(tbox, asserted, negated, self._budget)
        program = self.program = translation.program
        classes = [a.iri for a in tbox if isinstance(a, ax.Declaration) and a.kind == 'class']
        for name in classes:
            if name not in (THING, NOTHING):
                program.cls(name)
        self._budget.look()
        # The order matters: chains are spelt out before contexts are made, which know steps alone;
        # and the hierarchy is read before the requirements add clauses that would enter it.
        report_counted_chains(program)
        spell_out_chains(program)
        self._report_partial()
        labels = [program.labels[expression] for expression in asserted]
        fillers = [e.filler for e in program.existentials if isinstance(e.filler, Predicate)]
        simplify(program, [*labels, *fillers])
        self._contexts = Contexts(program, self._budget)
        self._above: dict[str, frozenset[str]] = {}
        self._impossible: set[str] = set()
        self.within: dict[str, frozenset[str]] = {}
        self._hierarchy()
        self._own = dict(self._above), frozenset(self._impossible)
        self._named_neighbours(translation)
        self._exclusions()
        self._requirements()
        drop_implied_atoms(program)
        program.clauses = list(dict.fromkeys(program.clauses))
        cores = [frozenset((predicate,)) for predicate in program.classes.values()]
        gaps = self._contexts.gaps([*cores, frozenset()])
        program.unsupported += (gap for gap in gaps if gap not in program.unsupported)

    def _report_partial(self) -> None:
        """Report what is defined by expressions whose members are not all recognised.

        Nothing is lost where the rest of a clause implies its head anyway.
        """
        program = self.program
        if not program.partial:
            return
        contexts = Contexts(program, self._budget)
        counted: set[object] = {least.filler for least in program.at_least}
        counted.update(most.filler for most in program.at_most)
        counted.update(key.cls for key in program.keys)
        for partial in program.partial:
            label, sentence = partial.label, partial.sentence
            if label in counted and sentence not in program.unsupported:
                program.unsupported.append(sentence)
            for clause in program.clauses:
                atoms = [atom for atom in clause.body if isinstance(atom, PredicateAtom)]
                # A rule may ask for it of several: each of them has to be recognised.
                asked = {atom.terms[0] for atom in atoms if atom.predicate is label}
                if all(partial.decided_by in self._places(atoms, x) for x in asked):
                    continue
                head = clause.head
                if isinstance(head, PredicateAtom) and head.predicate.kind == 'class':
                    context = contexts.context(self._implied(atoms, head.terms[0]) - {label})
                    if context.clash or head.predicate in context.tokens:
                        continue
                if sentence not in program.unsupported:
                    program.unsupported.append(sentence)

    def _implied(self, atoms: list[PredicateAtom], x: Term) -> set[Predicate]:
        """Return classes that an individual is in by some atoms, and by domains and ranges."""
        program = self.program
        places = self._places(atoms, x)
        found = {a.predicate for a in atoms if a.predicate.kind == 'class' and a.terms[0] == x}
        for clause in program.clauses:
            head = clause.head
            if len(clause.body) == 1 and isinstance(head, PredicateAtom) and not clause.named_only:
                (only,), (y, *_) = clause.body, head.terms
                if isinstance(only, PredicateAtom) and head.predicate.kind == 'class':
                    # A domain or range holds of all whom the property relates, not of those alone
                    # that it relates to themselves or to a certain individual.
                    variables = {term for term in only.terms if isinstance(term, int)}
                    at = only.terms.index(y) if y in variables else -1
                    if len(variables) == len(only.terms) and (only.predicate, at) in places:
                        found.add(head.predicate)
        return found - {program.thing}

    def _places(self, atoms: list[PredicateAtom], x: Term) -> set[tuple[Predicate, int]]:
        """Return where an individual stands by some atoms: a property and the place in it."""
        program = self.program
        places: set[tuple[Predicate, int]] = set()
        for atom in atoms:
            related = atom.predicate.expression
            if atom.predicate.kind != 'class':
                places |= {(atom.predicate, at) for at, term in enumerate(atom.terms) if term == x}
            elif atom.terms[0] == x:
                if isinstance(related, (ObjectMinCardinality, ObjectSomeValuesFrom)):
                    iri, inverted = directed(related.prop)
                    places.add((program.object(iri), int(inverted)))
                elif isinstance(related, (DataMinCardinality, DataSomeValuesFrom)):
                    places.add((program.data(related.prop), 0))
        return places

    # --- class hierarchy ---

    def superclasses(self, cls: str) -> set[str]:
        """Named classes strictly above; of a class that can have no members, every other class.

        One that no axiom about classes names is below what owl:Thing is below.
        """
        if cls in self._impossible:
            return {name for name in self._above if name not in (cls, THING)}
        return set(self._above.get(cls, self._above[THING])) - {cls}

    def subclasses(self, cls: str) -> set[str]:
        """Named classes strictly below, those that can have no members included."""
        found = {name for name, above in self._above.items() if cls in above}
        return (found | self._impossible) - {cls}

    def is_impossible(self, cls: str) -> bool:
        """Tell whether a named class can have no members."""
        return cls in self._impossible

    def complete(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Add what reasoning by cases found, and nothing of what it found before.

        Args:
            pairs: A class and one above it, or owl:Nothing.
        """
        self._above, self._impossible = dict(self._own[0]), set(self._own[1])
        for sub, sup in pairs:
            if sup == NOTHING:
                self._impossible.add(sub)
                self._above[sub] = frozenset()
            else:
                self._above[sub] = self._above.get(sub, frozenset()) | {sup}

    def below_by_itself(self, sub: str, sup: str) -> bool:
        """Tell whether a class is below another, or owl:Nothing, without reasoning by cases."""
        above, impossible = self._own
        return sub in impossible or sup == THING or sup in above.get(sub, ())

    def classes(self) -> tuple[str, ...]:
        """Return every named class, and owl:Thing, which may be below others, in a fixed order."""
        return tuple(self._above)

    def _hierarchy(self) -> None:
        contexts = self._contexts
        # The context of no class: what everybody is.
        everybody = contexts.context(())
        self._above[THING] = _named(everybody)
        if everybody.clash:
            # There is always some individual, so what nothing can be is a contradiction.
            nothing = PredicateAtom(self.program.nothing, (Constant(NOTHING),))
            self.program.clauses.append(Clause((), nothing))
        # One context a class: its tokens are all told and derived subsumers at once, so no pair of
        # classes is tested (Kazakov 2009; a tableau would test pairs, and needs told subsumers to
        # leave most of them out).
        for name, predicate in tuple(self.program.classes.items()):
            context = contexts.context((predicate,))
            if context.clash:
                self._impossible.add(name)
                self._add_clause((predicate,), PredicateAtom(self.program.nothing, (_X,)))
                self._above[name] = frozenset()
            else:
                self._above[name] = _named(context)
                names = frozenset(
                    token[1]
                    for token in context.tokens
                    if not isinstance(token, Predicate) and token[0] == 'is'
                )
                if names:
                    self.within[name] = names

    # --- what existentials mean for named individuals ---

    def _requirements(self) -> None:
        """Add what each existential implies alone; note whether several interact."""
        program, contexts = self.program, self._contexts
        labels = list(dict.fromkeys(existential.label for existential in program.existentials))
        alone: set[HeadAtom] = set()
        for label in labels:
            context = contexts.context((label,))
            if context.clash:
                self._add_clause((label,), PredicateAtom(program.nothing, (_X,)))
                continue
            stated = PredicateAtom(label, (_X,))
            # The forward engine makes no individuals: what the tree of required ones says of the
            # named one at its root is added as clauses about that one.
            for head in dict.fromkeys(contexts.heads_of(context)):
                if head != stated:
                    alone.add(head)
                    # What its classes alone imply has clauses already.
                    if head.terms != (_X,) or head.predicate in context.beyond:
                        self._add_clause((label,), head)
        relevant = self._relevant(labels)
        if not labels or not relevant or program.unsupported:
            return  # What is left out is found by cases in any event.
        everything = contexts.context(relevant, bare=True)
        # An individual in several classes may have to be more than each class says: tried for all
        # relevant ones together, which is the worst case. Where that adds nothing, no combination
        # does.
        if everything.clash or not self._follow_alone(relevant, alone):
            program.interacting = True

    def _follow_alone(self, relevant: frozenset[Predicate], alone: set[HeadAtom]) -> bool:
        """Tell whether all classes together imply no more than the existentials do one by one."""
        contexts = self._contexts
        everything = contexts.context(relevant, bare=True)
        stated = {PredicateAtom(token, (_X,)) for token in relevant - everything.derived}
        for head in set(contexts.heads_of(everything)) - alone - stated:
            if not isinstance(head, PredicateAtom) or head.predicate not in relevant:
                return False
            others = contexts.context(relevant - {head.predicate}, bare=True)
            if others.clash or head.predicate in others.derived:
                return False
        return True

    def _add_clause(self, body: tuple[Predicate, ...], head: HeadAtom) -> None:
        atoms = tuple(PredicateAtom(predicate, (_X,)) for predicate in body)
        if head not in atoms:
            self.program.clauses.append(Clause(atoms, head))

    def _relevant(self, labels: list[Predicate]) -> frozenset[Predicate]:
        """Return the classes that can make a difference to what an individual must be related
        to.
        """
        program, rules = self.program, self._contexts.rules.of_role
        roles: dict[Role, None] = {}
        for existential in program.existentials:
            if existential.prop.kind == 'object':
                role = (existential.prop, existential.inverse)
                for start in (role, turned(role)):
                    roles.update(closure(start, self._contexts.rules.possible_roles))
        found: set[Token] = set(labels)
        for role in roles:
            for rule in rules.get(role, ()):
                found |= rule.xs
        for clause in program.clauses:
            datas = [a for a in clause.body if isinstance(a, PredicateAtom)]
            if any(atom.predicate.kind == 'data' for atom in datas) and not clause.named_only:
                found |= {a.predicate for a in datas if a.predicate.kind == 'class'}
        for condition in program.at_most:
            if condition.label is not None:
                found.add(condition.label)
            if isinstance(condition.filler, Predicate):
                found.add(condition.filler)
        usable = (program.thing, program.nothing)
        return frozenset(
            token
            for token in found
            if isinstance(token, Predicate) and token.kind == 'class' and token not in usable
        )

    def _named_neighbours(self, translation: Translation) -> None:
        """Add what an existential requires of the one known individual that can fulfil it."""
        program = self.program
        for existential in program.existentials:
            role = (existential.prop, existential.inverse)
            above = translation.hierarchy.above_role(role[0].name, role[1])
            for least in program.at_least:
                counts = (least.prop.name, least.inverse) in above
                if counts and least.prop.kind == role[0].kind:
                    program.meetings.append((existential, least))
            for condition in program.at_most:
                if condition.prop.kind != role[0].kind:
                    continue
                if (condition.prop.name, condition.inverse) not in above:
                    continue
                # A functional property: the one that is known is the one that must exist.
                if condition.n == existential.n == 1:
                    self._only_neighbour(existential, condition)
                elif condition.n > 1 and condition.origin is not None:
                    sentence = f'{axiom_text(condition.origin)}: {_TOGETHER}'
                    if sentence not in program.unsupported:
                        program.unsupported.append(sentence)

    def _only_neighbour(self, existential: Existential, condition: AtMost) -> None:
        labels = [existential.label]
        if condition.label is not None:
            labels.append(condition.label)
        body = [PredicateAtom(label, (_X,)) for label in dict.fromkeys(labels)]
        wide = self._link(condition.prop, condition.inverse)
        narrow = self._link(existential.prop, existential.inverse)
        filler = existential.filler
        clauses: list[Clause] = []
        if isinstance(filler, ValueSet):
            atoms: tuple[BodyAtom, ...] = (*body, wide)
            outside, counted = ~filler, condition.filler
            if isinstance(counted, ValueSet):
                if not filler.within(counted):
                    return
                atoms = (*atoms, RangeAtom(counted, (_Y,)))
                outside = outside & counted
            clauses.append(Clause(atoms, narrow, existential.origin))
            if not outside.is_empty:
                atom = RangeAtom(outside, (_Y,))
                nothing = PredicateAtom(self.program.nothing, (_X,))
                clauses.append(Clause((*atoms, atom), nothing, existential.origin))
        else:
            counted = condition.filler
            if isinstance(counted, Predicate):
                tokens: Tokens = frozenset(() if filler is None else (filler,))
                if counted not in self._contexts.context(tokens).tokens:
                    return
                body.append(PredicateAtom(counted, (_Y,)))
            clauses.append(Clause((*body, wide), narrow, existential.origin))
            if filler is not None:
                head = PredicateAtom(filler, (_Y,))
                clauses.append(Clause((*body, wide), head, existential.origin))
        self.program.clauses += [c for c in clauses if c.head not in c.body]

    def _link(self, prop: Predicate, inverse: bool) -> PredicateAtom:
        return PredicateAtom(prop, (_Y, _X) if inverse else (_X, _Y))

    # --- properties that exclude each other ---

    def _exclusions(self) -> None:
        """Find the properties that can relate nothing to itself, or never the same two."""
        program = self.program
        if not (program.irreflexive or program.asymmetric or program.disjoint_properties):
            return
        props = list(program.objects.values())
        known = set(program.irreflexive)
        for prop in props:
            if prop not in known and self._excludes(('self', prop)):
                program.irreflexive.append(prop)
        pairs = set(program.disjoint_properties)
        # Pairs of properties are as many as their number squared: what excludes is gathered once,
        # and a pair is a test of sets.
        contradictions = self._contexts.rules.contradictions()
        above = {
            (prop, backwards): self._contexts.rules.roles_above((prop, backwards))
            for prop in props
            for backwards in (False, True)
        }
        for place, prop in enumerate(props):
            self._budget.count(len(props) - place)
            for other in props[place:]:
                for backwards in (False, True):
                    pair = (prop, False, other, backwards)
                    if pair in pairs or (prop is other and not backwards):
                        continue
                    roles = above[prop, False] | above[other, backwards]
                    if any(contradiction <= roles for contradiction in contradictions):
                        program.disjoint_properties.append(pair)

    def _excludes(self, token: Token) -> bool:
        return self._contexts.context((token,)).clash


def _named(context: Context) -> frozenset[str]:
    """Return the named classes of a context."""
    labels = (token for token in context.tokens if isinstance(token, Predicate))
    return frozenset(one.expression for one in labels if isinstance(one.expression, str))


_TOGETHER = 'together with what must exist, which are the same would need reasoning by cases'
