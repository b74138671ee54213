"""From a program to what runs: compiled joins and counters attached to the predicates that trigger
them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.cardinality import AtLeastCounter, AtMostCounter, KeyWatcher
from owl_reasoner.reasoner.clauses import (
    AtMost,
    BodyAtom,
    Clause,
    Constant,
    DifferentAtom,
    Fact,
    Predicate,
    PredicateAtom,
    Premises,
    Program,
    SameAtom,
    Term,
)
from owl_reasoner.reasoner.inequality import (
    AsymmetricEvidence,
    DisjointClassEvidence,
    DisjointPropertyEvidence,
    Inequality,
    IrreflexiveEvidence,
)
from owl_reasoner.reasoner.joins import (
    JoinContext,
    compile_call,
    compile_support,
    compile_trigger,
)
from owl_reasoner.reasoner.threshold_rules import ThresholdIndex, split_rule

Emit = Callable[[Fact], None]
MergeRequest = Callable[[str, str, Axiom | None, Premises], None]


class JoinNetwork:
    """Attaches everything a program needs to its predicates.

    Attributes:
        initial: Clauses without a condition on facts; run them once at the start.
        merging: Ask clauses whether two individuals are the same by what holds.
        naming: Clauses that name an individual; run them when it comes to stand for another, or
            ceases to.
        touch_insert, touch_delete: Called with an individual whose difference from others may have
            changed.
        touch_related: Like these, for individuals that differ because their values do.
        thresholds: The rules run by a sorted index.
        lower, counters: The watchers of lower and of upper bounds.
        context: The engine's tables, for compiled joins.
    """

    def __init__(
        self,
        program: Program,
        representative: dict[str, str],
        inequality: Inequality,
        enqueue: Emit,
        overdelete: Emit,
        insert: Emit,
        merge: MergeRequest,
        due: Callable[[], bool],
        looker: Callable[[Axiom | None], Callable[[], None]],
    ) -> None:
        self._program = program
        self._inequality = inequality
        self._enqueue, self._overdelete, self._merge = enqueue, overdelete, merge
        self.context = JoinContext(
            representative, inequality.different, program.different, due, looker
        )
        self.initial: list[Callable[[], None]] = []
        self.naming: list[Callable[[], None]] = []
        self.merging: list[Callable[[str, str], None]] = []
        self.touch_insert: list[Callable[[str], None]] = []
        self.touch_delete: list[Callable[[str], None]] = []
        self.touch_related: list[Callable[[str], list[str]]] = []
        self.thresholds: list[ThresholdIndex] = []
        self._insert, self._closing = insert, set[Predicate]()
        self._hooks: dict[Clause, list[tuple[list[Any], Any]]] = {}
        program.different.supports.append((inequality.premises, None))
        self.lower: list[AtLeastCounter] = []
        for at_least in program.at_least:
            counter = AtLeastCounter(at_least, inequality, enqueue, overdelete)
            self.lower.append(counter)
            if not counter.is_data:
                self.touch_insert.append(counter.touch_insert)
                self.touch_delete.append(counter.touch_delete)
        self.counters: list[AtMostCounter] = []
        # Bounds for everybody (functional properties) act first: what they merge, the others need
        # not count.
        for at_most in sorted(program.at_most, key=lambda condition: condition.label is not None):
            self.limit(at_most)
        for key in program.keys:
            KeyWatcher(key, merge)
        for clause in program.clauses:
            self.attach(clause)
        self._disjoint: dict[Predicate, None] = {}
        for predicate in tuple(program.predicates()):
            if predicate.disjoint:
                self.watch_disjoint(predicate)
        self._attach_evidence()

    # --- clauses ---

    def attach(self, clause: Clause) -> None:
        """Have a clause run from now on; what follows already is not looked for."""
        split = split_rule(clause)
        if split is not None:
            index = ThresholdIndex(clause, split, self.context, self._enqueue, self._overdelete)
            self.thresholds.append(index)
            return
        hooks = self._hooks[clause] = []

        def hook(place: list[Any], what: Any) -> None:
            place.append(what)
            hooks.append((place, what))

        context, body, head = self.context, clause.body, clause.head
        # Three functions for each clause: what it leads to from a new fact (semi-naive evaluation;
        # Abiteboul, Hull and Vianu, "Foundations of Databases", 1995, chapter 13), what it led to
        # from one that goes, and, from a fact, the premises it rests on. The last one is asked
        # instead of a record of all derivations, which would be larger than the facts.
        support = compile_support(context, body, head.terms, origin=clause.origin)
        gain: Callable[[BodyAtom | None, Sequence[Term]], Callable[..., None]]
        if isinstance(head, SameAtom):
            request = self._request_of(clause, head, support)
            hook(self.merging, request)
            gain = partial(
                compile_call, context, body, outputs=head.terms, call=request, origin=clause.origin
            )
            lose = None  # Who is the same is split by what its merges rest on.
        else:
            hook(head.predicate.supports, (support, clause.origin))
            trigger = partial(compile_trigger, context, body, head=head, origin=clause.origin)
            gain = partial(trigger, emit=self._enqueue, present=False)
            lose = partial(trigger, emit=self._overdelete, present=True)
        triggered = False
        # Transitive properties are closed by a hand-written step (`_close`).
        closed = transitive(clause)
        if closed is not None:
            hook(closed.on_insert, partial(self._close, closed, context.looker(clause.origin)))
        for atom in body:
            if isinstance(atom, PredicateAtom):
                triggered = True
                if closed is None:
                    hook(atom.predicate.on_insert, gain(atom, atom.terms))
                if lose is not None:
                    hook(atom.predicate.on_delete, lose(atom, atom.terms))
            elif isinstance(atom, DifferentAtom):
                for term in atom.terms:
                    hook(self.touch_insert, gain(None, (term,)))
                    if lose is not None:
                        hook(self.touch_delete, lose(None, (term,)))
        # What names an individual finds its facts under whoever stands for it: a merge or a split
        # changes that, and no fact comes that would tell.
        if not triggered or _names_individual(clause):
            run = gain(None, ())
            hook(self.naming, run)
            if not triggered:
                self.initial.append(run)

    def _close(self, predicate: Predicate, look: Callable[[], None], x: str, y: str) -> None:
        """Relate whoever leads to x with all that y leads to, by a transitive property.

        The relation was transitive before x was related to y, and is again afterwards: so the
        facts that are added here need not be joined with others, which would take a step for each
        way in which each of them follows. They must be there at once for that: what is only
        queued would be missed by the next fact.
        """
        sources, targets = (x, *predicate.pred.get(x, ())), (y, *predicate.succ.get(y, ()))
        due, insert, succ = self.context.due, self._insert, predicate.succ
        # The facts that are inserted below fire this step again, for what is being closed.
        if predicate in self._closing:
            return
        self._closing.add(predicate)
        for source in sources:
            known = succ.get(source, ())
            for target in targets:
                if due():
                    look()
                if target not in known:
                    insert((predicate, source, target))
                    known = succ[source]
        self._closing.discard(predicate)

    def detach(self, clause: Clause) -> None:
        """End a clause, which is no rule of a sorted index; what it derived stays."""
        for place, what in self._hooks.pop(clause):
            place.remove(what)

    def instances(self, clause: Clause, *, holding: bool) -> None:
        """Look through all facts for instances of a clause's body.

        Args:
            clause: Not one that makes individuals the same.
            holding: Overdelete the heads that hold; else enqueue those that do not.
        """
        head = clause.head
        assert isinstance(head, PredicateAtom)
        emit = self._overdelete if holding else self._enqueue
        compile_trigger(self.context, clause.body, None, (), head, emit, holding, clause.origin)()

    def _request_of(
        self, clause: Clause, head: SameAtom, support: Callable[..., Iterator[Premises]]
    ) -> Callable[[str, str], None]:
        """Return what asks for the merge of two individuals where a clause makes them the same.

        An individual that the clause names is merged under its own name: the individual that
        represents it now may cease to.
        """
        merge, origin = self._merge, clause.origin
        first, second = (
            str(term.value) if isinstance(term, Constant) else None for term in head.terms
        )

        def request(x: str, y: str) -> None:
            if x != y:
                # One derivation is enough: when its premises go, the split asks again.
                for premises in support(x, y):
                    merge(first or x, second or y, origin, premises)
                    return

        return request

    # --- bounds ---

    def limit(self, condition: AtMost) -> AtMostCounter:
        """Watch an upper bound, which may also tell individuals apart, from now on."""
        inequality, nothing = self._inequality, self._program.nothing
        counter = AtMostCounter(
            condition, inequality, nothing, self._enqueue, self._overdelete, self._merge
        )
        self.counters.append(counter)
        if not counter.is_data:
            counter.hook(self.touch_insert, counter.touch_insert)
            counter.hook(self.touch_delete, counter.touch_delete)
        if counter.is_data:
            counter.hook(inequality.evidence, counter)
            counter.prop.touching = (1,)
        elif counter.n == 1:
            counter.hook(inequality.through, counter)
            _also_touches(counter.prop, 2 if counter.inverse else 1)
            if counter.filler is not None:
                counter.filler.touching = (1,)
            counter.hook(self.touch_related, lambda y: list(counter.pred.get(y, ())))
        if counter.label is not None and (counter.is_data or counter.n == 1):
            counter.label.touching = (1,)
        return counter

    # --- disjoint classes ---

    def watch_disjoint(self, predicate: Predicate) -> bool:
        """Watch a class for members of classes disjoint with it; False where that is done."""
        if predicate in self._disjoint:
            return False
        nothing, enqueue, overdelete = self._program.nothing, self._enqueue, self._overdelete
        if not self._disjoint:
            nothing.supports.append((self._in_disjoint, 'these classes are disjoint'))
            self._inequality.evidence.append(DisjointClassEvidence(self._disjoint))
        self._disjoint[predicate] = None
        predicate.touching = (1,)

        def gain(x: str) -> None:
            for other in predicate.disjoint:
                if x in other.members:
                    enqueue((nothing, x))

        def lose(x: str) -> None:
            if x in nothing.members:
                overdelete((nothing, x))

        predicate.on_insert.append(gain)
        predicate.on_delete.append(lose)
        return True

    def _in_disjoint(self, x: str) -> Iterator[Premises]:
        for predicate in self._disjoint:
            if x in predicate.members:
                for other in predicate.disjoint:
                    if x in other.members:
                        yield ((predicate, x), (other, x))

    # --- inequality ---

    def _attach_evidence(self) -> None:
        program, evidence = self._program, self._inequality.evidence
        for predicate in program.irreflexive:
            evidence.append(IrreflexiveEvidence(predicate))
            predicate.touching = (1, 2)
        for predicate in program.asymmetric:
            evidence.append(AsymmetricEvidence(predicate))
            predicate.touching = (1, 2)
        for first, turned_first, second, turned_second in program.disjoint_properties:
            evidence.append(DisjointPropertyEvidence(first, second, turned_first != turned_second))
            _touch_individuals(first)
            _touch_individuals(second)
        for prop, negative in program.negatives.items():
            evidence.append(DisjointPropertyEvidence(prop, negative, False))
            _touch_individuals(prop)
            _touch_individuals(negative)
        program.apart.touching = (1, 2)


def transitive(clause: Clause) -> Predicate | None:
    """Return the property of which a clause says that it is transitive; None for other clauses."""
    head, body = clause.head, clause.body
    if not isinstance(head, PredicateAtom) or head.predicate.kind != 'object' or len(body) != 2:
        return None
    if clause.named_only or any(isinstance(term, Constant) for term in head.terms):
        return None
    first, second = body
    if not isinstance(first, PredicateAtom) or not isinstance(second, PredicateAtom):
        return None
    if first.predicate is not head.predicate or second.predicate is not head.predicate:
        return None
    if first.terms[0] != head.terms[0]:
        first, second = second, first
    (x, y), (z, w) = first.terms, second.terms
    linked = y == z and (x, w) == head.terms and isinstance(y, int)
    return head.predicate if linked and len({x, y, w}) == 3 else None


def _also_touches(predicate: Predicate, position: int) -> None:
    predicate.touching = tuple(sorted({*predicate.touching, position}))


def _touch_individuals(predicate: Predicate) -> None:
    predicate.touching = (1, 2) if predicate.kind == 'object' else (1,)


def _names_individual(clause: Clause) -> bool:
    terms = [term for atom in (*clause.body, clause.head) for term in atom.terms]
    return any(isinstance(term, Constant) and not term.is_value for term in terms)
