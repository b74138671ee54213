"""What follows for an individual from the classes it is in, unknown individuals included.

A consequence-based calculus for Horn description logics (Kazakov, "Consequence-driven reasoning
for Horn SHIQ ontologies", IJCAI 2009; Simancik, Kazakov, Horrocks, IJCAI 2011). A *context* stands
for every individual that is in all classes of its core; its tokens are what such an individual is
besides. An existential adds an edge to the context of the individual it requires; what must hold of
that individual because of its neighbour goes into the edge's core, so two different neighbours
never share what one of them causes. Contexts are shared by core, so there are finitely many and the
calculus ends without a bound on depth or number.

A token is a class predicate, ('is', individual), ('has', property, turned, individual),
('value', property, value) or ('self', property).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import combinations
from typing import Any, TypeAlias, TypeGuard

from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.vocabulary import local_name
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import (
    AtLeast,
    AtMost,
    Constant,
    HeadAtom,
    Predicate,
    PredicateAtom,
    Program,
    SameAtom,
    closure,
    turned,
)
from owl_reasoner.reasoner.consequence_based.rule_index import (
    EdgeRule,
    Role,
    RuleIndex,
    Token,
    Tokens,
)
from owl_reasoner.reasoner.value_sets import EVERY, NONE, ValueSet, point

_Gap: TypeAlias = tuple[Axiom | None, str]
_CASES = 'which of the related individuals are the same would need reasoning by cases'
_DATES = 'whether its values suit another range is not decided'
_NOMINALS = 'facts about the individual are not used for classes and unnamed individuals'


class _Edge:
    """`count` individuals that the owner is related to by all roles and that are in the core."""

    __slots__ = ('core', 'count', 'roles', 'seen', 'target')

    def __init__(self, roles: set[Role], core: set[Token], count: int, target: Context) -> None:
        self.roles, self.core, self.count, self.target = roles, core, count, target
        self.seen: object = None
        """What both ends and the roles were when the rules were last applied."""


class _Values:
    """`count` values that the owner has by all properties, in a set."""

    __slots__ = ('count', 'props', 'values')

    def __init__(self, props: set[Predicate], values: ValueSet, count: int) -> None:
        self.props, self.values, self.count = props, values, count


class Context:
    """What an individual with all tokens of the core is.

    Attributes:
        tokens: All tokens, the core included.
        clash: Whether there can be no such individual.
        edges, values: What it must be related to.
        names: The individuals that it is.
        unclosed, unrelated: Tokens whose consequences are not drawn yet.
        looped: How much was known when the rules were last applied to its loops.
        begun: Whether what its tokens imply was drawn once.
        derived: Tokens found by rules, whether the core had them already or not.
        beyond: Tokens found by what it is related to, not by its classes alone.
        users: Contexts with an edge to this one, or that wait for its clash.
    """

    __slots__ = (
        *('bare', 'begun', 'beyond', 'clash', 'core', 'derived', 'done', 'edges', 'looped'),
        *('loops', 'names', 'tokens', 'unclosed', 'unrelated', 'users', 'values'),
    )

    def __init__(self, core: Tokens, bare: bool) -> None:
        self.core, self.bare = core, bare
        self.tokens: set[Token] = set(core)
        self.clash = self.begun = False
        self.derived: set[Token] = set()
        self.beyond: set[Token] = set()
        self.edges: list[_Edge] = []
        self.values: list[_Values] = []
        self.loops: set[Role] = set()
        self.looped = (0, 0)
        self.users: dict[Context, None] = {}
        self.done: set[object] = set()
        self.names = [token[1] for token in core if _is_name(token)]
        self.unclosed: list[Token] = list(core)
        self.unrelated: list[Token] = list(core)

    def describe(self) -> str:
        """Return whom the context stands for, in words."""
        named = [local_name(one.name) for one in self.core if isinstance(one, Predicate)]
        return 'what is implied by ' + (', '.join(sorted(named)) or 'owl:Thing')


class Contexts:
    """Completes contexts of one program; rules of SWRL take no part.

    Large because the rules of the calculus work on one set of contexts, in turn.

    Attributes:
        rules: What follows from what.
    """

    def __init__(self, program: Program, budget: Budget) -> None:
        self._program, self._budget = program, budget
        self._gaps: dict[Context, dict[_Gap, AtLeast | AtMost | None]] = {}
        self._known: dict[tuple[Tokens, bool], Context] = {}
        self._opened: list[Context] = []
        self._waiting: dict[Context, None] = {}
        self.rules = RuleIndex(program)
        self._has_names = False
        self._existentials: dict[Token, list[Any]] = {}
        for existential in program.existentials:
            self._existentials.setdefault(existential.label, []).append(existential)
        self._at_most = [c for c in program.at_most if c.prop.kind == 'object']
        self._at_most_values = [c for c in program.at_most if c.prop.kind == 'data']
        self._at_least = [c for c in program.at_least if c.prop.kind == 'object']
        self._at_least_values = [c for c in program.at_least if c.prop.kind == 'data']

    # --- questions ---

    def context(self, core: Iterable[Token], bare: bool = False) -> Context:
        """Return the completed context of a core; `bare`: without what classes alone imply."""
        found = self._open(frozenset(core), bare)
        self._budget.stage = 'classifying'
        # The newest core first: it is completed before those that asked for it look again.
        while self._opened or self._waiting:
            # What an individual is by itself comes before what its neighbours make of it.
            self._complete(self._opened.pop() if self._opened else self._waiting.popitem()[0])
        return found

    def gaps(self, cores: Iterable[Tokens]) -> dict[str, None]:
        """Return sentences about axioms whose consequences for these cores may be incomplete."""
        found: dict[str, None] = {}
        reached: dict[Context, None] = {}
        for core in cores:
            pending = [self.context(core)]
            while pending:
                one = pending.pop()
                if one not in reached:
                    reached[one] = None
                    pending += [edge.target for edge in one.edges]
        for context in reached:
            if not context.clash:
                for (origin, what), condition in self._gaps.get(context, {}).items():
                    known = isinstance(condition, AtLeast) and condition.head in context.tokens
                    if not known:
                        subject = 'an assertion' if origin is None else axiom_text(origin)
                        found[f'{subject}: {what}'] = None
        return found

    def heads_of(self, context: Context) -> Iterator[HeadAtom]:
        """Yield the tokens and edges of a context as heads of clauses about individual 0."""
        for token in context.tokens:
            if isinstance(token, Predicate):
                yield PredicateAtom(token, (0,))
            elif token[0] == 'is':
                yield SameAtom((0, Constant(token[1])))
            elif token[0] == 'self':
                yield PredicateAtom(token[1], (0, 0))
        for held in context.values:
            if held.values.size == held.count:
                for value in held.values.members():
                    for prop in held.props:
                        yield PredicateAtom(prop, (0, Constant(value, True)))
        for edge in context.edges:
            for name in edge.target.names:
                for predicate, backwards in edge.roles:
                    terms = (Constant(name), 0) if backwards else (0, Constant(name))
                    yield PredicateAtom(predicate, terms)
        yield from self._about_named(context)

    def _about_named(self, context: Context) -> Iterator[HeadAtom]:
        """Yield what named individuals are because of individuals that must exist."""
        if not self._has_names:
            return
        for one in closure(context, lambda one: [edge.target for edge in one.edges]):
            for name in one.names:
                for token in one.tokens:
                    if isinstance(token, Predicate):
                        yield PredicateAtom(token, (Constant(name),))
                for edge in one.edges:
                    for other in edge.target.names:
                        for predicate, backwards in edge.roles:
                            pair = Constant(name), Constant(other)
                            yield PredicateAtom(predicate, pair[::-1] if backwards else pair)

    # --- completion ---

    def _open(self, core: Tokens, bare: bool = False) -> Context:
        found = self._known.get((core, bare))
        if found is None:
            found = self._known[core, bare] = Context(core, bare)
            self._has_names |= bool(found.names)
            found.clash = self._program.nothing in core
            self._opened.append(found)
        return found

    def _complete(self, context: Context) -> None:
        known = len(context.tokens) if context.begun else -1
        self._budget.at_work = context.describe
        self._changed = True
        while self._changed and not context.clash:
            self._changed = False
            self._budget.count(len(context.edges) + 1)
            # From what costs least to what costs most: classes by themselves, then edges, then
            # merging and counting, which compare edges with each other.
            self._close(context)
            self._relate(context)
            for edge in tuple(context.edges):
                self._budget.tick()
                if edge in context.edges:
                    self._along(context, edge)
            self._loops(context)
            self._merge(context)
            self._count(context)
            self._evaluate(context)
        context.begun = True
        if context.clash or len(context.tokens) > known or context.edges:
            for user in context.users:
                self._enqueue_if_news(user, context)

    def _enqueue_if_news(self, user: Context, context: Context) -> None:
        size = sum(len(edge.roles) + len(edge.core) for edge in context.edges)
        news = (context, len(context.tokens), context.clash, len(context.edges), size)
        # A user looks again only at a state that it has not seen: contexts may ask for each other
        # in a ring.
        if news not in user.done:
            user.done.add(news)
            self._waiting[user] = None

    def _clash(self, context: Context) -> None:
        context.clash = self._changed = True

    def _add(self, context: Context, token: Token, *, beyond: bool = True) -> None:
        context.derived.add(token)
        if token not in context.tokens:
            if beyond:
                context.beyond.add(token)
            context.tokens.add(token)
            context.unclosed.append(token)
            context.unrelated.append(token)
            if _is_name(token):
                context.names.append(token[1])
                self._has_names = True
            self._changed = True

    def _close(self, context: Context) -> None:
        """Add what classes imply without relations."""
        if context.bare:
            return
        tokens = context.tokens
        for token, _ in self.rules.always:
            if token is None:
                self._clash(context)
            elif token not in tokens:
                self._add(context, token, beyond=False)
        while context.unclosed:
            one = context.unclosed.pop()
            for body, token in self.rules.of_class.get(one, ()):
                if (token is None or token not in tokens) and body <= tokens:
                    if token is None:
                        self._clash(context)
                        return
                    self._add(context, token, beyond=False)

    def _relate(self, context: Context) -> None:
        """Add the edges and values that the tokens require."""
        while context.unrelated:
            token = context.unrelated.pop()
            if isinstance(token, Predicate):
                for existential in self._existentials.get(token, ()):
                    filler = existential.filler
                    if existential.prop.kind == 'data':
                        self._value(context, existential.prop, filler, existential.n)
                    else:
                        role = (existential.prop, existential.inverse)
                        core = set() if filler is None else {filler}
                        self._edge(context, role, core, existential.n)
            elif token[0] == 'has':
                self._edge(context, (token[1], token[2]), {('is', token[3])}, 1)
            elif token[0] == 'self':
                context.loops |= {(token[1], False), (token[1], True)}
                self._changed = True
            elif token[0] == 'value':
                self._value(context, token[1], point(token[2]), 1)

    def _edge(self, context: Context, role: Role, core: set[Token], count: int) -> None:
        target = self._open(frozenset(core))
        target.users[context] = None
        context.edges.append(_Edge({role}, core, count, target))
        self._changed = True

    def _value(self, context: Context, prop: Predicate, values: ValueSet, count: int) -> None:
        context.values.append(_Values({prop}, values, count))
        self._changed = True

    def _retarget(self, context: Context, edge: _Edge) -> None:
        edge.target = self._open(frozenset(edge.core))
        edge.target.users[context] = None
        self._changed = True

    # --- edges ---

    def _along(self, context: Context, edge: _Edge) -> None:
        """Apply the rules that speak of both ends of an edge."""
        target = edge.target
        if target.clash:
            self._clash(context)
        elif target.begun:
            tokens = context.tokens
            # Sizes stand for the sets themselves: tokens and roles only grow.
            seen = target, len(tokens), len(target.tokens), len(edge.roles)
            if seen != edge.seen:
                edge.seen = seen
                size = len(edge.core)
                for role in tuple(edge.roles):
                    for rule in self.rules.along(role, target.tokens, bool(target.names)):
                        if rule.xs <= tokens and rule.ys <= target.tokens:
                            if rule.roles <= edge.roles:
                                self._fire(context, edge, rule)
                        elif rule.xs <= tokens and target.names:
                            self._gap(context, rule.origin, _NOMINALS)
                # What the neighbour makes of its successor goes into the core, and the edge leads
                # to another context: contexts stay shared, and none holds what only one neighbour
                # causes (Simancik, Kazakov and Horrocks 2011).
                if len(edge.core) > size:
                    self._retarget(context, edge)
            self._join_parent(context, edge)

    def _fire(self, context: Context, edge: _Edge, rule: EdgeRule) -> None:
        head = rule.head
        if head[0] == 'clash':
            self._clash(context)
        elif head[0] == 'x':
            self._add(context, head[1])
        elif head[0] == 'role':
            if head[1] not in edge.roles:
                edge.roles.add(head[1])
                self._changed = True
        elif head[1] not in edge.target.tokens:
            edge.core.add(head[1])

    def _join_parent(self, context: Context, edge: _Edge) -> None:
        """Where the other end may have one such neighbour only, and this is it."""
        target = edge.target
        if not target.edges and not target.names:
            return
        back = {turned(role) for role in edge.roles}
        named = bool(target.names)
        for condition in self._at_most:
            role = (condition.prop, condition.inverse)
            if role not in back:
                continue
            if named:
                self._gap(context, condition.origin, _NOMINALS)
            if not _holds(condition.label, target.tokens):
                continue
            if not _holds(condition.filler, context.tokens):
                continue
            # Which of several successors is the parent would be a choice: no Horn clause.
            if condition.n != 1:
                if any(role in other.roles for other in target.edges):
                    self._case_gap(context, condition)
                continue
            for other in target.edges:
                if role in other.roles and _holds(condition.filler, other.target.tokens):
                    if other.count > 1:
                        self._clash(context)
                        return
                    for token in other.core:
                        self._add(context, token)
                    fresh = {turned(r) for r in other.roles} - edge.roles
                    if fresh:
                        edge.roles |= fresh
                        self._changed = True

    def _loops(self, context: Context) -> None:
        """Apply the rules to what relates an individual to itself."""
        looped = len(context.loops), len(context.tokens)
        if not context.loops or looped == context.looped:
            return
        context.looped = looped
        for role in tuple(context.loops):
            for rule in self.rules.of_role.get(role, ()):
                if rule.roles <= context.loops and rule.xs | rule.ys <= context.tokens:
                    head = rule.head
                    if head[0] == 'clash':
                        self._clash(context)
                    elif head[0] == 'role':
                        context.loops |= {head[1], turned(head[1])}
                    else:
                        self._add(context, head[1])
        for predicate, _ in tuple(context.loops):
            self._add(context, ('self', predicate))

    # --- counting ---

    def _merge(self, context: Context) -> None:
        """Make one edge of those that must lead to the same individual."""
        for condition in self._at_most:
            if condition.n == 1 and _holds(condition.label, context.tokens):
                role = (condition.prop, condition.inverse)
                counted = [
                    edge
                    for edge in context.edges
                    if role in edge.roles and _holds(condition.filler, edge.target.tokens)
                ]
                if role in context.loops and _holds(condition.filler, context.tokens):
                    for edge in counted:
                        self._into_itself(context, edge)
                    counted = []
                for other in counted[1:]:
                    self._unite(context, counted[0], other)
                if any(edge.count > 1 for edge in counted):
                    self._clash(context)
        # Two edges to one named individual are one edge.
        named = [edge for edge in context.edges if edge.target.names]
        if any(edge.count > 1 for edge in named):
            self._clash(context)
        for one, other in combinations(named, 2):
            shared = set(one.target.names) & set(other.target.names)
            if shared and one in context.edges and other in context.edges:
                self._unite(context, one, other)

    def _unite(self, context: Context, kept: _Edge, gone: _Edge) -> None:
        kept.roles |= gone.roles
        kept.core |= gone.core
        kept.count = max(kept.count, gone.count)
        context.edges.remove(gone)
        self._retarget(context, kept)

    def _into_itself(self, context: Context, edge: _Edge) -> None:
        for token in edge.core:
            self._add(context, token)
        context.loops |= edge.roles | {turned(role) for role in edge.roles}
        context.edges.remove(edge)
        self._changed = True

    def _count(self, context: Context) -> None:
        conditions: list[AtLeast | AtMost] = [*self._at_least, *self._at_most]
        for condition in conditions:
            needed = condition.n if isinstance(condition, AtLeast) else condition.n + 1
            if isinstance(condition, AtLeast):
                if condition.head in context.derived:
                    continue
            elif condition.n == 1 or not _holds(condition.label, context.tokens):
                continue
            role = (condition.prop, condition.inverse)
            counted = [
                edge
                for edge in context.edges
                if role in edge.roles and _holds(condition.filler, edge.target.tokens)
            ]
            if sum(edge.count for edge in counted) < needed:
                continue
            # Two requirements may be met by one individual: an edge that another one serves as well
            # counts no second time.
            counted = [edge for edge in counted if not _is_redundant(edge, counted)]
            if sum(edge.count for edge in counted) < needed:
                continue
            if self._most_different(context, counted) >= needed:
                if isinstance(condition, AtLeast):
                    self._add(context, condition.head)
                else:
                    self._clash(context)
            else:
                self._case_gap(context, condition)

    def _most_different(self, context: Context, edges: list[_Edge]) -> int:
        """Return how many individuals pairwise known to be different some of the edges lead to."""
        order = sorted(edges, key=lambda edge: -edge.count)
        apart = {
            (one, other): self._different(context, one, other)
            for one, other in combinations(order, 2)
        }
        best = 0
        chosen: list[_Edge] = []

        # Exact, by branching: there are few edges, and a greedy clique may miss the largest.
        def extend(place: int, total: int) -> None:
            nonlocal best
            self._budget.tick()
            best = max(best, total)
            for next_place in range(place, len(order)):
                edge = order[next_place]
                if all(apart[one, edge] for one in chosen):
                    chosen.append(edge)
                    extend(next_place + 1, total + edge.count)
                    chosen.pop()

        extend(0, 0)
        return best

    def _different(self, context: Context, one: _Edge, other: _Edge) -> bool:
        roles = one.roles | other.roles
        both = self._open(frozenset(one.core | other.core))
        both.users[context] = None
        tokens = both.tokens
        return both.clash or any(
            rule.head == ('clash',)
            and rule.roles <= roles
            and rule.xs <= context.tokens
            and rule.ys <= tokens
            for role in roles
            for rule in self.rules.of_role.get(role, ())
        )

    def _case_gap(self, context: Context, condition: AtLeast | AtMost) -> None:
        self._gap(context, condition.origin, _CASES, condition)

    def _gap(
        self,
        context: Context,
        origin: Axiom | None,
        what: str,
        condition: AtLeast | AtMost | None = None,
    ) -> None:
        """Note an axiom some of whose consequences in a context may be missing."""
        self._gaps.setdefault(context, {})[origin, what] = condition

    # --- values ---

    def _evaluate(self, context: Context) -> None:
        """Apply the rules about values and count them."""
        if not context.values:
            return
        for held in tuple(context.values):
            self._along_value(context, held)
        # Fewer values first, then counting them: merging changes the count.
        for condition in self._at_most_values:
            if _holds(condition.label, context.tokens):
                self._limit_values(context, condition)
        for least in self._at_least_values:
            if least.head not in context.derived:
                counted = self._counted_values(context, least)
                if sum(held.count for held in counted) >= least.n:
                    if self._most_distinct(counted) >= least.n:
                        self._add(context, least.head)
                    else:
                        self._case_gap(context, least)
        for held in context.values:
            if held.values.size < held.count:
                self._clash(context)

    def _along_value(self, context: Context, held: _Values) -> None:
        for prop in tuple(held.props):
            for rule in self.rules.of_prop.get(prop, ()):
                if not rule.xs <= context.tokens:
                    continue
                head = rule.head
                if head[0] == 'clash':
                    rest = held.values & ~(
                        rule.values & self._had(context, rule.props - held.props)
                    )
                    if rest != held.values:
                        held.values = rest
                        self._changed = True
                elif not rule.props <= held.props:
                    continue
                # All that the value may be suits the rule; a part of it would be a case.
                elif held.values.within(rule.values):
                    if head[0] == 'x':
                        self._add(context, head[1])
                    elif head[1] not in held.props:
                        held.props.add(head[1])
                        self._changed = True
                elif not (held.values & rule.values).decided:
                    self._gap(context, rule.origin, _DATES)

    def _had(self, context: Context, props: frozenset[Predicate]) -> ValueSet:
        """Return the values that an individual certainly has by all of some properties."""
        found = EVERY
        for prop in props:
            certain = NONE
            for held in context.values:
                if prop in held.props and held.values.size == held.count:
                    certain |= held.values
            found &= certain
        return found

    def _counted_values(self, context: Context, condition: AtLeast | AtMost) -> list[_Values]:
        admitted = condition.filler
        assert not isinstance(admitted, Predicate)
        return [
            held
            for held in context.values
            if condition.prop in held.props and (admitted is None or held.values.within(admitted))
        ]

    def _limit_values(self, context: Context, condition: AtMost) -> None:
        counted = self._counted_values(context, condition)
        if condition.n == 1:
            for other in counted[1:]:
                kept = counted[0]
                kept.props |= other.props
                kept.values &= other.values
                kept.count = max(kept.count, other.count)
                context.values.remove(other)
                self._changed = True
            if counted and counted[0].count > 1:
                self._clash(context)
        elif sum(held.count for held in counted) > condition.n:
            if self._most_distinct(counted) > condition.n:
                self._clash(context)
            else:
                self._case_gap(context, condition)

    def _most_distinct(self, counted: list[_Values]) -> int:
        best = 0
        for size in range(len(counted), 0, -1):
            for chosen in combinations(counted, size):
                self._budget.tick()
                if all((a.values & b.values).is_empty for a, b in combinations(chosen, 2)):
                    best = max(best, sum(held.count for held in chosen))
        return best


def _holds(token: Any, tokens: set[Token]) -> bool:
    return token is None or token in tokens


def _is_name(token: Token) -> TypeGuard[tuple[Any, ...]]:
    return isinstance(token, tuple) and token[0] == 'is'


def _is_redundant(edge: _Edge, others: list[_Edge]) -> bool:
    """Tell whether an individual that another edge leads to serves for this edge as well."""
    for other in others:
        if other is not edge and edge.count <= other.count and edge.roles <= other.roles:
            mine, theirs = edge.target.tokens, other.target.tokens
            equal = mine == theirs and edge.roles == other.roles and edge.count == other.count
            if mine <= theirs and not (equal and others.index(edge) < others.index(other)):
                return True
    return False
