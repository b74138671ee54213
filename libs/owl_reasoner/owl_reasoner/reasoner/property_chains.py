"""Property chains and transitivity as steps from one individual to the next.

A clause about R(x, y), where R follows from a chain, also holds where the chain runs over
individuals that must exist but are not known. So each such clause gets an automaton that accepts
the chains of R (Horrocks and Sattler, "Decidability of SHIQ with complex role inclusion axioms",
2004): its states are labels, its steps are clauses over single properties. Automata that begin with
the same class share what they have in common: a label stands for all that members of a class are
related to by a property.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import count
from typing import Any, TypeAlias

from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.clauses import (
    AtLeast,
    AtMost,
    BodyAtom,
    Clause,
    Constant,
    Existential,
    HeadAtom,
    Predicate,
    PredicateAtom,
    Program,
    SameAtom,
    Term,
    UnsupportedError,
    closure,
    turned,
)
from owl_reasoner.reasoner.consequence_based.rule_index import Role

AnyRole: TypeAlias = tuple[Any, bool]
Step: TypeAlias = tuple[int, 'AnyRole | None', int]
_X, _Y = 0, 1
_CIRCLE = 'its property chains depend on each other in a circle'


def spell_out_chains(program: Program) -> None:
    """Add the steps of every chain to a program's clauses, where classes relate their members."""
    _Spelling(program).run()


def report_counted_chains(program: Program) -> None:
    """Report what counts by a property that a chain or transitivity implies.

    OWL 2 DL admits none (Structural Specification, 11.2): it makes reasoning undecidable. What is
    found is right, but it is not all.
    """
    chains = _Spelling(program).chains
    counting: list[AtLeast | AtMost | Existential] = [*program.at_most]
    counting += [least for least in program.at_least if least.n > 1]
    counting += [existential for existential in program.existentials if existential.n > 1]
    for one in counting:
        if one.prop.kind == 'object' and chains.is_complex((one.prop, one.inverse)):
            subject = 'the ontology' if one.origin is None else axiom_text(one.origin)
            sentence = f'{subject}: a property with chains is counted'
            if sentence not in program.unsupported:
                program.unsupported.append(sentence)


def chains_take_cases(program: Program) -> bool:
    """Tell whether steps from one individual to the next may not find all that chains imply.

    They do not where a chain leads over somebody unnamed and back to where it came from, as it may
    then join two named individuals, nor where those that a chain leads to are counted.
    """
    chains = _Spelling(program).chains
    if any(chains.is_complex((least.prop, least.inverse)) for least in program.at_least):
        return True
    roles = {(each.prop, each.inverse) for each in program.existentials}
    try:
        return any(_turns(chains, chains.steps(role), roles) for role in chains)
    except UnsupportedError:
        return True  # Reasoning by cases names it.


def _turns(chains: Chains, steps: list[Step], roles: set[AnyRole]) -> bool:
    silent: dict[int, list[int]] = {}
    for before, role, after in steps:
        if role is None:
            silent.setdefault(before, []).append(after)
    for _, out, here in steps:
        if out is None:
            continue
        ways = {turned(each) for each in roles.intersection(chains.roles_below(out))}
        states = set(closure(here, lambda state: silent.get(state, ())))
        for before, back, _ in steps:
            if (
                back is not None
                and before in states
                and ways.intersection(chains.roles_below(back))
            ):
                return True
    return False


class Chains:
    """The chains that imply each role; a role is a property's key and whether it is turned."""

    def __init__(self) -> None:
        self._chains: dict[AnyRole, list[tuple[AnyRole, ...]]] = {}
        self._below: dict[AnyRole, dict[AnyRole, None]] = {}
        self._automata: dict[AnyRole, list[Step]] = {}
        self._complex: dict[AnyRole, bool] = {}

    def __bool__(self) -> bool:
        return bool(self._chains)

    def __iter__(self) -> Iterator[AnyRole]:
        return iter(tuple(self._chains))

    def imply(self, chain: tuple[AnyRole, ...], role: AnyRole) -> None:
        """Note that a chain, or with one part a property, implies a role."""
        self._automata.clear()
        self._complex.clear()
        back = tuple(turned(one) for one in reversed(chain))
        if len(chain) == 1:
            self._below.setdefault(role, {})[chain[0]] = None
            self._below.setdefault(turned(role), {})[back[0]] = None
        else:
            self._chains.setdefault(role, []).append(tuple(chain))
            self._chains.setdefault(turned(role), []).append(back)

    def roles_below(self, role: AnyRole) -> list[AnyRole]:
        """Return the role and every role that implies it by itself."""
        return list(closure(role, lambda one: self._below.get(one, ())))

    def stated_below(self, role: AnyRole) -> list[AnyRole]:
        """Return the roles that are stated to imply the role by themselves."""
        return list(self._below.get(role, ()))

    def complex_roles(self) -> list[AnyRole]:
        """Return the roles that a chain implies."""
        return [role for role in {**self._chains, **self._below} if self.is_complex(role)]

    def is_complex(self, role: AnyRole) -> bool:
        """Whether a chain implies the role."""
        found = self._complex.get(role)
        if found is None:
            found = any(one in self._chains for one in self.roles_below(role))
            self._complex[role] = found
        return found

    def implying(self, role: AnyRole) -> list[tuple[AnyRole, ...]]:
        """Return the chains that are stated to imply the role."""
        return self._chains.get(role, [])

    def ends_in(self, role: AnyRole) -> bool:
        """Tell whether the last step of every chain that implies the role does so by itself."""
        below = self.roles_below(role)
        return all(chain[-1] in below for one in below for chain in self.implying(one))

    def steps(self, role: AnyRole) -> list[Step]:
        """Return the automaton of a role: its steps from state 0 to state 1.

        Raises:
            UnsupportedError: The role's chains use a role that depends on it.
        """
        found = self._automata.get(role)
        if found is None:
            found = []
            self._accept(role, 0, 1, found, (), count(2))
            self._automata[role] = found
        return found

    def _accept(
        self,
        role: AnyRole,
        first: int,
        last: int,
        steps: list[Step],
        above: tuple[AnyRole, ...],
        fresh: count[int],
    ) -> None:
        """Add the steps between two states of a role's own that its chains make.

        Raises:
            UnsupportedError: The role's chains use a role that depends on it.
        """
        below = self.roles_below(role)
        if any(one in above for one in below):
            raise UnsupportedError(_CIRCLE)
        equal = [one for one in below if role in self.roles_below(one)]
        stack = (*above, *equal)
        steps.append((first, role, last))
        for one in below:
            if one not in equal and one in self._chains:
                self._detour(one, first, last, steps, stack, fresh)
        for chain in [chain for one in equal for chain in self.implying(one)]:
            inner, start, end = list(chain), first, last
            if len(inner) == 2 and inner[0] in equal and inner[1] in equal:
                steps.append((last, None, first))
                continue
            if inner[0] in equal:
                start, inner = last, inner[1:]
            elif inner[-1] in equal:
                end, inner = first, inner[:-1]
            here = start
            for place, part in enumerate(inner):
                there = end if place == len(inner) - 1 else next(fresh)
                self._detour(part, here, there, steps, stack, fresh)
                here = there

    def _detour(
        self,
        role: AnyRole,
        here: int,
        there: int,
        steps: list[Step],
        above: tuple[AnyRole, ...],
        fresh: count[int],
    ) -> None:
        """Leads from one state to another along a role, through states of its own."""
        if not self.is_complex(role):
            if role in above:
                raise UnsupportedError(_CIRCLE)
            steps.append((here, role, there))
            return
        first, last = next(fresh), next(fresh)
        steps.append((here, None, first))
        steps.append((last, None, there))
        self._accept(role, first, last, steps, above, fresh)


class _Spelling:
    def __init__(self, program: Program) -> None:
        self._program = program
        self.chains = Chains()
        self._sources: dict[tuple[BodyAtom, ...], Predicate] = {}
        self._reached: dict[tuple[Predicate | None, AnyRole], Predicate] = {}
        for clause in program.clauses:
            if not clause.named_only:
                self._read(clause)

    def _read(self, clause: Clause) -> None:
        """Take a clause that implies a property from properties alone."""
        head = clause.head
        if not isinstance(head, PredicateAtom) or head.predicate.kind != 'object':
            return
        atoms = [atom for atom in clause.body if isinstance(atom, PredicateAtom)]
        plain = all(atom.predicate.kind == 'object' for atom in atoms)
        if not atoms or len(atoms) != len(clause.body) or not plain:
            return
        start, end = head.terms
        here, chain, rest = start, [], list(atoms)
        while rest:
            step = next((a for a in rest if here in a.terms and a.terms[0] != a.terms[1]), None)
            if step is None or any(isinstance(term, Constant) for term in step.terms):
                return
            rest.remove(step)
            backwards = step.terms[0] != here
            chain.append((step.predicate, backwards))
            here = step.terms[0] if backwards else step.terms[1]
        if here != end or start == end:
            return
        self.chains.imply(tuple(chain), (head.predicate, False))

    # --- clauses ---

    def run(self) -> None:
        if not self.chains or not self._relates_members():
            return
        for clause in tuple(self._program.clauses):
            if not clause.named_only:
                self._extend(clause)
        self._individuals()
        self._loops()

    def _relates_members(self) -> bool:
        """Tell whether a class relates its members to somebody unnamed, a name, or themselves."""
        if any(existential.prop.kind == 'object' for existential in self._program.existentials):
            return True
        heads = (clause.head for clause in self._program.clauses if not clause.named_only)
        return any(
            isinstance(head, PredicateAtom)
            and head.predicate.kind == 'object'
            and (head.terms[0] == head.terms[1] or isinstance(head.terms[1], Constant))
            for head in heads
        )

    def _extend(self, clause: Clause) -> None:
        links = [
            atom
            for atom in clause.body
            if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'object'
        ]
        if len(links) != 1:
            return
        (link,) = links
        one, other = link.terms
        if one == other or (isinstance(one, Constant) and isinstance(other, Constant)):
            return
        role = (link.predicate, False)
        if not self.chains.is_complex(role):
            return
        rest = [atom for atom in clause.body if atom is not link]
        used = {t for atom in (*rest, clause.head) for t in atom.terms}
        if not {t for t in used if isinstance(t, int)} <= {one, other}:
            return
        if set(clause.head.terms) >= {one, other}:
            return  # One property below another: its chains are followed by `_below`.
        to = other if other in clause.head.terms else one
        if to == one:
            role, one = turned(role), other
        if isinstance(to, Constant):
            return
        source = [atom for atom in rest if one in atom.terms]
        if not source and isinstance(one, int) and self.chains.ends_in(role):
            return  # Whatever begins the chain: the clause itself holds of its last step.
        target = [atom for atom in rest if one not in atom.terms]
        self._automaton(source, one, role, target, to, clause.head, clause)

    def _automaton(
        self,
        source: Iterable[BodyAtom],
        start: Term,
        role: Role,
        target: Iterable[BodyAtom],
        end: Term,
        head: HeadAtom,
        clause: Clause,
    ) -> None:
        moved = tuple(_moved(atom, start, _X) for atom in source)
        if isinstance(start, Constant):
            moved = (*moved, SameAtom((_X, start)))
        try:
            reached = self._reach(self._source(moved, clause.origin), role, (), clause.origin)
        except UnsupportedError as reason:
            text = 'the ontology' if clause.origin is None else axiom_text(clause.origin)
            sentence = f'{text}: {reason}'
            if sentence not in self._program.unsupported:
                self._program.unsupported.append(sentence)
            return
        last = (PredicateAtom(reached, (_X,)), *(_moved(atom, end, _X) for atom in target))
        self._add(Clause(last, _moved(head, end, _X), clause.origin))  # type: ignore[arg-type]

    def _add(self, clause: Clause) -> None:
        self._program.clauses.append(clause)

    def _label(self, *parts: Any) -> Predicate:
        label = Predicate('class', f'reached {len(self._program.labels)}', ('reached', *parts))
        self._program.labels[label.expression] = label
        return label

    def _source(self, atoms: tuple[BodyAtom, ...], origin: Axiom | None) -> Predicate | None:
        """Return a label of whom the atoms hold, None for everybody."""
        if not atoms:
            return None
        first = atoms[0]
        if len(atoms) == 1 and isinstance(first, PredicateAtom) and first.predicate.kind == 'class':
            return None if first.predicate is self._program.thing else first.predicate
        label = self._sources.get(atoms)
        if label is None:
            label = self._sources[atoms] = self._label('source', len(self._sources))
            self._add(Clause(atoms, PredicateAtom(label, (_X,)), origin))
        return label

    def _reach(
        self,
        start: Predicate | None,
        role: AnyRole,
        above: tuple[AnyRole, ...],
        origin: Axiom | None,
    ) -> Predicate:
        """Return the label of all that members of a class (None: everybody) are related to by a
        role.

        Raises:
            UnsupportedError: The role's chains use a role that depends on it.
        """
        key = (start, role)
        if key in self._reached:
            return self._reached[key]
        chains = self.chains
        below = chains.roles_below(role)
        if any(one in above for one in below):
            raise UnsupportedError(_CIRCLE)
        equal = [one for one in below if role in chains.roles_below(one)]
        stack = (*above, *equal)
        end = self._label(start and (start.expression or start.name), role[0].name, role[1])

        def step(here: Predicate | None, part: AnyRole, there: Predicate) -> None:
            pair = (_Y, _X) if part[1] else (_X, _Y)
            members = () if here is None else (PredicateAtom(here, (_X,)),)
            body = (*members, PredicateAtom(part[0], pair))
            self._add(Clause(body, PredicateAtom(there, (_Y,)), origin))

        def pass_on(here: Predicate, there: Predicate) -> None:
            body = (PredicateAtom(here, (_X,)),)
            self._add(Clause(body, PredicateAtom(there, (_X,)), origin))

        def repeats(chain: tuple[AnyRole, ...]) -> bool:
            return chain[-1] in equal and (len(chain) == 2 or chain[0] not in equal)

        own = [chain for one in equal for chain in chains.implying(one)]
        if start is not None and any(map(repeats, own)):
            first = self._label('first', end.expression)
            pass_on(start, first)
            start = first
        step(start, role, end)
        for one in dict.fromkeys(one for each in equal for one in chains.stated_below(each)):
            if one not in equal and chains.is_complex(one):
                pass_on(self._reach(start, one, stack, origin), end)
        for chain in own:
            here, there, inner = start, end, chain
            if chain[0] in equal and chain[-1] in equal and len(chain) == 2:
                if start is not None:
                    pass_on(end, start)
                continue
            if chain[0] in equal:
                here, inner = end, chain[1:]
            elif chain[-1] in equal:
                if start is None:
                    continue  # Whoever the chain leads to begins one anyway.
                there, inner = start, chain[:-1]
            for part in inner[:-1]:
                here = self._reach(here, part, stack, origin)
            if chains.is_complex(inner[-1]):
                pass_on(self._reach(here, inner[-1], stack, origin), there)
            else:
                step(here, inner[-1], there)
        self._reached[key] = end
        return end

    def _individuals(self) -> None:
        """Chains that end at an individual the classes name."""
        names = {
            term.value: None
            for clause in self._program.clauses
            if not clause.named_only
            for atom in (*clause.body, clause.head)
            if not isinstance(atom, PredicateAtom) or atom.predicate.kind == 'object'
            for term in atom.terms
            if isinstance(term, Constant) and not term.is_value
        }
        for name in names:
            for role in self.chains:
                constant = Constant(name)
                terms = (constant, _X) if role[1] else (_X, constant)
                head = PredicateAtom(role[0], terms)
                origin = Clause((), head)
                self._automaton([SameAtom((_X, constant))], _X, turned(role), [], _X, head, origin)

    def _loops(self) -> None:
        """Chains whose every step relates an individual to itself."""
        for role in self.chains:
            for chain in self.chains.implying(role):
                body = tuple(dict.fromkeys(PredicateAtom(prop, (_X, _X)) for prop, _ in chain))
                head = PredicateAtom(role[0], (_X, _X))
                if not role[1] and head not in body:
                    self._add(Clause(body, head))


def _moved(atom: BodyAtom, old: Term, new: Term) -> BodyAtom:
    """Return the atom with a variable renamed."""
    terms = tuple(new if term == old else term for term in atom.terms)
    return replace(atom, terms=terms)  # type: ignore[arg-type]
