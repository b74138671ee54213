"""Clauses as rules about contexts: what follows for an individual, an edge or a value.

The first step of the calculus of `contexts`: each clause about one individual, or about one and
what it is directly related to, becomes a rule under an index. A clause about more than that is left
to what spells chains out (`property_chains`), or to reasoning by cases.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.clauses import (
    BodyAtom,
    Clause,
    Constant,
    HeadAtom,
    Predicate,
    PredicateAtom,
    Program,
    RangeAtom,
    SameAtom,
    Term,
    closure,
    turned,
)
from owl_reasoner.reasoner.value_sets import EVERY, ValueSet, point

Token: TypeAlias = 'Predicate | tuple[Any, ...]'
Tokens: TypeAlias = frozenset[Token]
Role: TypeAlias = tuple[Predicate, bool]


@dataclass(frozen=True, slots=True)
class EdgeRule:
    """For x related to y by all roles, with tokens of both: a token of x or y, a role, or a clash.

    `head` is ('x', token), ('y', token), ('role', role) or ('clash',).
    """

    roles: frozenset[Role]
    xs: Tokens
    ys: Tokens
    head: tuple[Any, ...]
    origin: Axiom | None


@dataclass(frozen=True, slots=True)
class ValueRule:
    """For x with a value in `values` by all properties: a token, a property, or a clash."""

    props: frozenset[Predicate]
    xs: Tokens
    values: ValueSet
    head: tuple[Any, ...]
    origin: Axiom | None


class _Body:
    """What a clause's body says of each term, and of each pair of terms.

    Attributes:
        tokens: What an individual is.
        roles: How one is related to another, each pair in one direction.
        datas: Whose value a value is, and by which properties.
        values: The set that a value is in, where there is one.
    """

    def __init__(self) -> None:
        self.tokens: dict[Any, set[Token]] = {}
        self.roles: dict[tuple[Any, Any], set[Role]] = {}
        self.datas: dict[Any, tuple[Any, set[Predicate]]] = {}
        self.values: dict[Any, ValueSet] = {}

    def takes(self, atom: BodyAtom) -> bool:
        """Add an atom; return False for one that no context can use."""
        if isinstance(atom, PredicateAtom):
            return self._takes_fact(atom.predicate, atom.terms)
        if isinstance(atom, SameAtom):
            one, other = map(_key, atom.terms)
            if isinstance(one, tuple):
                one, other = other, one
            self.tokens.setdefault(one, set()).add(other)
            return isinstance(other, tuple)
        if isinstance(atom, RangeAtom):
            (v,) = atom.terms
            self.values[v] = self.values.get(v, EVERY) & atom.values
            return True
        return False

    def _takes_fact(self, predicate: Predicate, terms: tuple[Term, ...]) -> bool:
        if predicate.kind == 'class':
            self.tokens.setdefault(_key(terms[0]), set()).add(predicate)
        elif predicate.kind == 'data':
            x, v = terms
            self.datas.setdefault(v, (x, set()))[1].add(predicate)
            if isinstance(v, Constant):
                self.values[v] = point(v.value)
        elif predicate.kind == 'object':
            one, other = map(_key, terms)
            if one == other:
                self.tokens.setdefault(one, set()).add(('self', predicate))
            elif (other, one) in self.roles:
                self.roles[other, one].add((predicate, True))
            else:
                self.roles.setdefault((one, other), set()).add((predicate, False))
        else:
            return False
        return True


class RuleIndex:
    """The clauses of one program as rules about contexts, found by what a context has.

    Rules are found by a token, role or property of their body, so that a step looks only at those
    that its newest fact may complete, instead of at all of the ontology.

    Args:
        program: What the axioms mean; rules of SWRL take no part.

    Attributes:
        always: Tokens of every individual, with the axiom; None: there can be no individual.
        of_class: Rules about one individual by each token of their body; a head None is a clash.
        of_role: Rules about an individual and a neighbour by each role of their body.
        of_prop: Rules about an individual and its values by each property of their body.
    """

    def __init__(self, program: Program) -> None:
        self._program = program
        self.always: list[tuple[Token | None, Axiom | None]] = []
        self.of_class: dict[Token, list[tuple[Tokens, Token | None]]] = {}
        self.of_role: dict[Role, list[EdgeRule]] = {}
        self.of_prop: dict[Predicate, list[ValueRule]] = {}
        # Those of a role by one token of y, made when the first edge asks: most properties of a
        # large ontology have few rules, and no edge at all in many contexts.
        self._of_neighbour: dict[Role, dict[Token | None, list[EdgeRule]]] = {}
        for clause in program.clauses:
            # A rule for named individuals says nothing of those that must exist (DL-safety).
            if not clause.named_only:
                self._take(clause)
        for predicate in program.predicates():
            for other in predicate.disjoint:
                self._take_class_body(frozenset((predicate, other)), None, None)

    def _take(self, clause: Clause) -> None:
        """Index a clause about one individual, or one and what it is directly related to.

        Chains of properties are spelt out as steps by `classification`.
        """
        body = _Body()
        if not all(map(body.takes, clause.body)):
            return
        for tokens in body.tokens.values():
            tokens.discard(self._program.thing)
        if body.datas:
            self._take_values(clause, body.tokens, body.datas, body.values)
        elif not body.roles:
            self._take_class(clause, body.tokens)
        # Both ways round: the rule may fire from either end, and a context sees its own successors
        # only.
        elif len(body.roles) == 1:
            (((one, other), roles),) = body.roles.items()
            self._take_edge(clause, one, other, frozenset(roles), body.tokens)
            self._take_edge(clause, other, one, frozenset(map(turned, roles)), body.tokens)

    def _take_edge(
        self,
        clause: Clause,
        x: Any,
        y: Any,
        roles: frozenset[Role],
        tokens: dict[Any, set[Token]],
    ) -> None:
        """Index a clause as a rule about x and the y that it is related to."""
        if isinstance(x, tuple):
            return
        xs, ys = frozenset(tokens.get(x, ())), set(tokens.get(y, ()))
        if isinstance(y, tuple):
            ys.add(y)
        head = self._edge_head(clause, x, y)
        if head is not None:
            rule = EdgeRule(roles, xs, frozenset(ys), head, clause.origin)
            for role in roles:
                self.of_role.setdefault(role, []).append(rule)

    def _edge_head(self, clause: Clause, x: Any, y: Any) -> tuple[Any, ...] | None:
        head = clause.head
        if isinstance(head, PredicateAtom) and head.predicate.kind == 'object':
            one, other = map(_key, head.terms)
            if (one, other) == (x, y):
                return 'role', (head.predicate, False)
            if (one, other) == (y, x):
                return 'role', (head.predicate, True)
        place, token = self._token(head)
        if token is None:
            return ('clash',) if place is not None else None
        if place == x:
            return 'x', token
        return ('y', token) if place == y else None

    def _token(self, head: HeadAtom) -> tuple[Any, Token | None]:
        """Return what a head says of one individual, as (place, token).

        Without a token it is a clash, without a place nothing that a context can use.
        """
        if isinstance(head, SameAtom):
            one, other = map(_key, head.terms)
            if isinstance(one, tuple):
                one, other = other, one
            return (one, other) if isinstance(other, tuple) else (None, None)
        predicate, terms = head.predicate, head.terms
        if predicate is self._program.nothing:
            return _key(terms[0]), None
        if predicate.kind == 'class':
            return _key(terms[0]), predicate
        if predicate.kind == 'data':
            value = terms[1]
            if isinstance(value, Constant):
                return terms[0], ('value', predicate, value.value)
            return None, None
        if predicate.kind != 'object':
            return None, None
        one, other = map(_key, terms)
        if one == other:
            return one, ('self', predicate)
        if isinstance(other, tuple):
            return one, ('has', predicate, False, other[1])
        if isinstance(one, tuple):
            return other, ('has', predicate, True, one[1])
        return None, None

    def _take_class(self, clause: Clause, tokens: dict[Any, set[Token]]) -> None:
        place, token = self._token(clause.head)
        if len(tokens) > 1 or place is None or isinstance(place, tuple):
            return
        body = frozenset(tokens.get(place, ()))
        if set(tokens) <= {place}:
            self._take_class_body(body, token, clause.origin)

    def _take_class_body(self, body: Tokens, token: Token | None, origin: Axiom | None) -> None:
        if not body:
            self.always.append((token, origin))
        for one in body:
            self.of_class.setdefault(one, []).append((body, token))

    def _take_values(
        self,
        clause: Clause,
        tokens: dict[Any, set[Token]],
        datas: dict[Any, tuple[Any, set[Predicate]]],
        values: dict[Any, ValueSet],
    ) -> None:
        if len(datas) != 1:
            return
        ((v, (x, props)),) = datas.items()
        if isinstance(x, Constant) or not set(tokens) <= {x}:
            return
        head: tuple[Any, ...] | None = None
        atom = clause.head
        if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'data' and atom.terms[1] == v:
            head = ('prop', atom.predicate)
        else:
            place, token = self._token(atom)
            if place == x:
                head = ('clash',) if token is None else ('x', token)
        if head is not None:
            xs = frozenset(tokens.get(x, ()))
            rule = ValueRule(frozenset(props), xs, values.get(v, EVERY), head, clause.origin)
            for prop in props:
                self.of_prop.setdefault(prop, []).append(rule)

    def roles_above(self, role: Role) -> frozenset[Role]:
        """Return the role and every role that it implies by itself."""
        return frozenset(closure(role, self._implied_roles))

    def _implied_roles(self, role: Role) -> list[Role]:
        return [
            rule.head[1]
            for rule in self.of_role.get(role, ())
            if rule.head[0] == 'role' and not (rule.xs or rule.ys) and len(rule.roles) == 1
        ]

    def possible_roles(self, role: Role) -> list[Role]:
        """Roles, turned ones too, that an edge with this one may come to have."""
        heads = [r.head[1] for r in self.of_role.get(role, ()) if r.head[0] == 'role']
        return [*heads, *map(turned, heads)]

    def contradictions(self) -> list[frozenset[Role]]:
        """Return sets of roles by all of which one individual cannot be related to another."""
        found = {
            rule.roles: None
            for rules in self.of_role.values()
            for rule in rules
            if rule.head[0] == 'clash' and not (rule.xs or rule.ys)
        }
        return list(found)

    def along(self, role: Role, tokens: Iterable[Token], is_named: bool) -> Iterator[EdgeRule]:
        """Yield the rules that may say something of who is related by a role to a neighbour.

        Args:
            role: The role.
            tokens: What the neighbour is.
            is_named: It is an individual with a name: all rules, to tell what is left out.

        Ontologies have thousands of rules for one property, each for another class of what is
        related: they are found by one of its classes (as in ELK; Kazakov, Kroetzsch and Simancik,
        "The incredible ELK", Journal of Automated Reasoning 53, 2014).
        """
        if is_named:
            yield from self.of_role.get(role, ())
            return
        index = self._of_neighbour.get(role)
        if index is None:
            index = self._of_neighbour[role] = {}
            for rule in self.of_role.get(role, ()):
                # Under one token is enough: the rule needs all of them.
                index.setdefault(next(iter(rule.ys), None), []).append(rule)
        yield from index.get(None, ())
        for token in tuple(tokens):
            yield from index.get(token, ())


def _key(term: Any) -> Any:
    """Return a term of a clause: a variable's number, or ('is', individual)."""
    return ('is', term.value) if isinstance(term, Constant) else term
