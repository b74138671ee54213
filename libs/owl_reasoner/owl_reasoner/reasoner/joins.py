"""Joins compiled to Python: the atoms of a body in the order of what is bound, as nested loops.

For each clause and each of its atoms there is a function that takes a new (or vanishing) fact's
arguments and yields what follows; for each clause there is a generator that takes the head's
arguments and yields the premises it follows from. The source depends only on the shape of a clause,
so compiled code is shared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType
from typing import Any, TypeVar

from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.clauses import (
    BodyAtom,
    ComputedAtom,
    Constant,
    DifferentAtom,
    Fact,
    Predicate,
    PredicateAtom,
    RangeAtom,
    SameAtom,
    Term,
)

_EMPTY: frozenset[Any] = frozenset()
_DEEPEST = 16
_LATER = 1000
"""The cost of an atom some of whose terms another one has to bind first."""
T = TypeVar('T')


@lru_cache(maxsize=4096)
def _code(source: str) -> CodeType:
    # Compiling takes far longer than making a function of known code, and an ontology has
    # few shapes of clauses: the objects are parameters of the factory, not part of the text.
    return compile(source, '<join>', 'exec')


@dataclass(frozen=True)
class JoinContext:
    """What compiled joins need from the engine.

    Attributes:
        representative: From an individual to the one that stands for it, where that is another.
        different: Whether two individuals are known to be different.
        different_predicate: Names difference in premises.
        due: A join calls it before each of its inner loops; where it is true, also what `looker`
            returns for the clause's axiom, which may raise an error to end the join.
    """

    representative: dict[str, str]
    different: Callable[[str, str], bool]
    different_predicate: Predicate
    due: Callable[[], bool]
    looker: Callable[[Axiom | None], Callable[[], None]]


def join_order(body: Iterable[T], bound: Set[Term], kind: Callable[[T], str | None]) -> Iterator[T]:
    """Yield the atoms of a body, the one next that costs least by what is bound then.

    Greedy, one atom at a time: bodies have two to five atoms, and sizes of tables change while the
    order stays. What is bound decides more than how many facts there are.

    Args:
        body: Atoms of facts, of comparisons and of computations.
        bound: The variables that are bound; whoever takes an atom adds its own.
        kind: What facts make an atom true: 'class', 'object' or 'data'; None for no facts.
    """
    waiting = list(body)
    while waiting:
        atom = min(waiting, key=lambda one: _cost(one, bound, kind(one)))
        waiting.remove(atom)
        yield atom


def _cost(atom: Any, bound: Set[Term], kind: str | None) -> int:
    is_free = [isinstance(term, int) and term not in bound for term in atom.terms]
    free = sum(is_free)
    if kind is not None:
        if free == 0:
            return 0
        if kind == 'class':
            return 40
        if free < len(is_free):
            return 10
        return 50 if kind == 'object' else 60
    if free == 0:
        return 1 if isinstance(atom, (SameAtom, RangeAtom)) else 2 + isinstance(atom, DifferentAtom)
    solvable = isinstance(atom, ComputedAtom) and atom.solve is not None and is_free[0]
    return 4 if free == 1 and (solvable or isinstance(atom, SameAtom)) else _LATER


def _kind(atom: BodyAtom) -> str | None:
    return atom.predicate.kind if isinstance(atom, PredicateAtom) else None


class _Writer:
    """Writes one join function; objects it uses become parameters of an enclosing factory."""

    def __init__(self, context: JoinContext, origin: Axiom | None) -> None:
        self.context, self.look = context, context.looker(origin)
        self.loops = 0
        self.lines: list[str] = []
        self.depth = 2
        self.objects: list[object] = []
        self.names: dict[int, str] = {}
        self.bound: set[int] = set()
        self.temporaries = 0
        self.parts = 0
        # Temporaries that a loop still needs when the function goes on in a further part.
        self.kept: list[str] = []
        self.calling = ''

    def line(self, text: str) -> None:
        self.lines.append('    ' * self.depth + text)

    def open(self, text: str) -> None:
        if self.depth >= _DEEPEST:
            self._continue()
        self.line(text)
        self.depth += 1

    def loop(self, text: str) -> None:
        """Begin a loop. Those inside another one count, as only these can take long."""
        if self.loops:
            due, look = self.use(self.context.due), self.use(self.look)
            self.line(f'if {due}(): {look}()')
        self.loops += 1
        self.open(text)

    def _continue(self) -> None:
        """Go on in a further function: Python nests no more than 20 blocks in one."""
        self.parts += 1
        name = f'part{self.parts}'
        values = ', '.join([f'v{term}' for term in sorted(self.bound)] + self.kept)
        self.line(f'{self.calling}{name}({values})')
        self.lines.append(f'    def {name}({values}):')
        self.depth = 2

    def use(self, thing: object) -> str:
        name = self.names.get(id(thing))
        if name is None:
            name = self.names[id(thing)] = f'o{len(self.objects)}'
            self.objects.append(thing)
        return name

    def temporary(self) -> str:
        self.temporaries += 1
        return f't{self.temporaries}'

    def is_bound(self, term: Term) -> bool:
        return isinstance(term, Constant) or term in self.bound

    def text(self, term: Term) -> str:
        if isinstance(term, int):
            return f'v{term}'
        constant = self.use(term.value)
        if isinstance(term.value, str) and not term.is_value:
            return f'{self.use(self.context.representative)}.get({constant}, {constant})'
        return constant

    def bind(self, term: Term, value: str) -> None:
        """Bind an argument that is given, or checks it where the term is bound already."""
        if self.is_bound(term):
            self.open(f'if {self.text(term)} == {value}:')
        else:
            assert isinstance(term, int)
            self.line(f'v{term} = {value}')
            self.bound.add(term)

    # --- steps ---

    def step(self, atom: BodyAtom) -> None:
        if isinstance(atom, PredicateAtom):
            if atom.predicate.kind == 'class':
                self._class_step(atom)
            else:
                self._property_step(atom)
        elif isinstance(atom, DifferentAtom):
            pair = ', '.join(map(self.text, atom.terms))
            self.open(f'if {self.use(self.context.different)}({pair}):')
        elif isinstance(atom, SameAtom):
            first, second = atom.terms
            if not self.is_bound(first):
                first, second = second, first
            if self.is_bound(second):
                self.open(f'if {self.text(first)} == {self.text(second)}:')
            else:
                self.bind(second, self.text(first))
        elif isinstance(atom, RangeAtom):
            self.open(f'if {self.use(atom.values.contains)}({self.text(atom.terms[0])}):')
        elif atom.solve is None:
            arguments = ', '.join(map(self.text, atom.terms))
            self.open(f'if {self.use(atom.holds)}({arguments}):')
        else:
            result = atom.terms[0]
            values = f'{self.use(atom.solve)}({", ".join(map(self.text, atom.terms[1:]))})'
            if self.is_bound(result):
                self.open(f'if {self.text(result)} in {values}:')
            else:
                self.loop(f'for v{result} in {values}:')
                self.bound.add(result)  # type: ignore[arg-type]

    def _class_step(self, atom: PredicateAtom) -> None:
        (term,) = atom.terms
        members = self.use(atom.predicate.members)
        if self.is_bound(term):
            self.open(f'if {self.text(term)} in {members}:')
        else:
            self.loop(f'for v{term} in {members}:')
            self.bound.add(term)  # type: ignore[arg-type]

    def _property_step(self, atom: PredicateAtom) -> None:
        x, y = atom.terms
        succ, empty = self.use(atom.predicate.succ), self.use(_EMPTY)
        if self.is_bound(x) and self.is_bound(y):
            self.open(f'if {self.text(y)} in {succ}.get({self.text(x)}, {empty}):')
        elif self.is_bound(x):
            self.loop(f'for v{y} in {succ}.get({self.text(x)}, {empty}):')
            self.bound.add(y)  # type: ignore[arg-type]
        elif self.is_bound(y):
            self.loop(f'for v{x} in {self.use(atom.predicate.pred)}.get({self.text(y)}, {empty}):')
            self.bound.add(x)  # type: ignore[arg-type]
        elif x == y:
            values = self.temporary()
            self.loop(f'for v{x}, {values} in {succ}.items():')
            self.bound.add(x)  # type: ignore[arg-type]
            self.kept = [values]
            self.open(f'if v{x} in {values}:')
            self.kept = []
        else:
            values = self.temporary()
            self.loop(f'for v{x}, {values} in {succ}.items():')
            self.bound.add(x)  # type: ignore[arg-type]
            self.kept = [values]
            self.loop(f'for v{y} in {values}:')
            self.kept = []
            self.bound.add(y)  # type: ignore[arg-type]

    def join(self, atoms: Sequence[BodyAtom], early: Callable[[], bool] | None = None) -> None:
        """Write all atoms, cheapest first; `early` may write more once it finds its variables
        bound.
        """
        pending = early
        for atom in join_order(atoms, self.bound, _kind):
            if pending is not None and pending():
                pending = None
            self.step(atom)
        if pending is not None:
            pending()

    def finish(self, signature: str) -> Callable[..., Any]:
        parameters = ', '.join(f'o{number}' for number in range(len(self.objects)))
        source = f'def make({parameters}):\n    def join({signature}):\n'
        source += '\n'.join(self.lines or ['        pass']) + '\n    return join\n'
        namespace: dict[str, Any] = {}
        exec(_code(source), namespace)
        made: Callable[..., Any] = namespace['make'](*self.objects)
        return made


def _arguments(writer: _Writer, terms: Sequence[Term]) -> str:
    names = [f'a{position}' for position in range(len(terms))]
    for term, name in zip(terms, names, strict=True):
        writer.bind(term, name)
    return ', '.join(names)


def compile_trigger(
    context: JoinContext,
    body: Sequence[BodyAtom],
    given: BodyAtom | None,
    terms: Sequence[Term],
    head: PredicateAtom,
    emit: Callable[[Fact], None],
    present: bool,
    origin: Axiom | None = None,
) -> Callable[..., None]:
    """Return a function of the values of `terms` that emits each head of an instance of the body.

    Args:
        context: The engine's tables.
        body: The clause's body.
        given: The atom whose fact is at hand and need not be looked up; None for no such atom.
        terms: What the function's arguments bind.
        head: What to emit.
        emit: Called with head facts.
        present: Emit only heads that hold (True: they may have to go) or do not hold yet (False).
        origin: The clause's axiom, named where the join has to end early.
    """
    writer = _Writer(context, origin)
    signature = _arguments(writer, terms)
    predicate = head.predicate

    # The head is looked up as soon as its variables are bound, not at the end: most instances of a
    # body lead to what is there already, and the loops inside are saved for all of them.
    def guard() -> bool:
        if not all(map(writer.is_bound, head.terms)):
            return False
        negation = '' if present else 'not '
        texts = list(map(writer.text, head.terms))
        if predicate.kind == 'class':
            writer.open(f'if {texts[0]} {negation}in {writer.use(predicate.members)}:')
        else:
            found = f'{writer.use(predicate.succ)}.get({texts[0]}, {writer.use(_EMPTY)})'
            writer.open(f'if {texts[1]} {negation}in {found}:')
        return True

    writer.join([atom for atom in body if atom is not given], guard)
    fact = ', '.join([writer.use(predicate), *map(writer.text, head.terms)])
    writer.line(f'{writer.use(emit)}(({fact}))')
    return writer.finish(signature)


def compile_call(
    context: JoinContext,
    body: Sequence[BodyAtom],
    given: BodyAtom | None,
    terms: Sequence[Term],
    outputs: Sequence[Term],
    call: Callable[..., None],
    origin: Axiom | None = None,
) -> Callable[..., None]:
    """Like `compile_trigger`, but calls `call` with the values of `outputs` for each instance."""
    writer = _Writer(context, origin)
    signature = _arguments(writer, terms)
    writer.join([atom for atom in body if atom is not given])
    writer.line(f'{writer.use(call)}({", ".join(map(writer.text, outputs))})')
    return writer.finish(signature)


def compile_support(
    context: JoinContext,
    body: Sequence[BodyAtom],
    terms: Sequence[Term],
    outputs: Sequence[Term] = (),
    origin: Axiom | None = None,
) -> Callable[..., Iterator[Any]]:
    """Return a generator of the premises of each instance of the body in which `terms` have the
    given values.

    With `outputs` it yields pairs (values of the outputs, premises).
    """
    writer = _Writer(context, origin)
    # A generator: whoever asks for a reason stops at the first one that holds.
    writer.calling = 'yield from '
    signature = _arguments(writer, terms)
    writer.join(body)
    premises = ''
    for atom in body:
        if isinstance(atom, PredicateAtom):
            parts: Iterable[str] = (writer.use(atom.predicate), *map(writer.text, atom.terms))
        elif isinstance(atom, DifferentAtom):
            predicate = writer.use(context.different_predicate)
            parts = (predicate, *map(writer.text, atom.terms))
        else:
            continue
        premises += f'({", ".join(parts)}), '
    if outputs:
        values = ''.join(f'{writer.text(term)}, ' for term in outputs)
        writer.line(f'yield ({values}), ({premises})')
    else:
        writer.line(f'yield ({premises})')
    return writer.finish(signature)
