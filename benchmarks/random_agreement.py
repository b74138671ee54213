"""How far the reasoner agrees with HermiT and Pellet on random ontologies.

    python benchmarks/random_agreement.py [--number 1000] [--first 0] [--cases 0.2] [--special 0]
    python benchmarks/random_agreement.py --dense

Each ontology is drawn by `libs/owl_reasoner/tests/wide_ontologies.py` from its number as seed:
every construct of OWL 2 DL, nested to depth 4; `--cases` says how likely a union, an enumeration or
a complement is drawn. With `--dense` names and kinds of axioms are few, so that they meet, and
there are rules. The Java reasoner (a copy that owlready2 brings: HermiT 1.3.8, Pellet 2.3.1) stays
in one JVM and is asked by refutation: types of individuals, values of properties, same and
different, subclasses.
`unsound` are facts derived here and refuted there, `silent` those that follow there, are not
derived here, and whose ontology has nothing in `unsupported`; `named` those where something is
reported; `settled` are differences in which the other Java reasoner answers as here.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.sizes import sized_parser, skip
from libs.owl_reasoner.tests.java_reasoner import KINDS, JavaReasoner, JavaReasonerError, absent
from libs.owl_reasoner.tests.wide_ontologies import DenseOntology, WideOntology
from owl_reasoner import KnowledgeBase, write_ontology
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    DifferentIndividuals,
    DisjointClasses,
    DisjointUnion,
    EquivalentClasses,
    ObjectPropertyAssertion,
    SameIndividual,
    SubClassOf,
)
from owl_reasoner.owl.expressions import ObjectUnionOf
from owl_reasoner.owl.vocabulary import NOTHING

IRI = 'http://example.org/wide'
COLUMNS = ('ontologies', 'refused', 'no answer', 'inconsistent', 'questions', 'right', 'settled')
FAULTS = ('named', 'silent', 'unsound', 'false inconsistency', 'crash')


def questions(axioms: list[Axiom]) -> Iterator[Axiom]:
    """Yield every fact that could follow."""
    values = {(a.prop, a.literal) for a in axioms if isinstance(a, DataPropertyAssertion)}
    names = defaultdict(list)
    for axiom in axioms:
        if isinstance(axiom, Declaration):
            names[axiom.kind].append(axiom.iri)
    for one in names['individual']:
        for cls in names['class']:
            yield ClassAssertion(cls, one)
        for prop, value in sorted(values, key=repr):
            yield DataPropertyAssertion(prop, one, value)
        for other in names['individual']:
            for prop in names['object_property']:
                yield ObjectPropertyAssertion(prop, one, other)
            if one < other:
                yield SameIndividual(frozenset((one, other)))
                yield DifferentIndividuals(frozenset((one, other)))
    for sub in names['class']:
        for sup in (*names['class'], NOTHING):
            if sub != sup:
                yield SubClassOf(sub, sup)


def words_for(fact: Axiom) -> tuple[str, ...]:
    """Return the words that ask a Java reasoner for a fact.

    Raises:
        TypeError: It is no fact of the kinds that `questions` has.
    """
    if isinstance(fact, ClassAssertion):
        return 'class', str(fact.cls), fact.individual
    if isinstance(fact, DataPropertyAssertion):
        return 'data', fact.prop, fact.subject, fact.literal.lexical, fact.literal.datatype
    if isinstance(fact, ObjectPropertyAssertion):
        return 'object', fact.prop, fact.subject, fact.object
    if isinstance(fact, SameIndividual):
        return 'same', *sorted(fact.individuals)
    if isinstance(fact, DifferentIndividuals):
        return 'different', *sorted(fact.individuals)
    if isinstance(fact, SubClassOf):
        return 'subclass', str(fact.sub), str(fact.sup)
    raise TypeError(fact)


def drawn_axioms(seed: int, cases: float = 0.2, special: float = 0.0) -> list[Axiom]:
    """Return the random ontology of a seed."""
    drawn = WideOntology(seed, cases, special)
    return drawn.ontology(drawn.random.randrange(1, 13), drawn.random.randrange(3, 14))


def dense_axioms(seed: int) -> list[Axiom]:
    """Return the random ontology of a seed, of few names and few kinds of axioms."""
    drawn = DenseOntology(seed)
    return drawn.ontology(drawn.random.randrange(1, 9), drawn.random.randrange(2, 9))


def spelt_out(axioms: list[Axiom]) -> Iterator[Axiom]:
    """Return the axioms with disjoint unions in two parts: the Java copies do not read them."""
    for axiom in axioms:
        if isinstance(axiom, DisjointUnion):
            yield EquivalentClasses((axiom.cls, ObjectUnionOf(axiom.classes)))
            yield DisjointClasses(axiom.classes)
        else:
            yield axiom


class Comparison:
    """Compares one ontology after the other, and counts.

    Args:
        kind: The Java reasoner.
        seconds: Its longest time for an ontology.
    """

    def __init__(self, kind: str, seconds: float) -> None:
        self._kind, self._seconds = kind, seconds
        self._java: dict[str, JavaReasoner] = {}
        self.counts: Counter[str] = Counter()
        self.time = 0.0

    def compare(self, seed: int, axioms: list[Axiom], path: Path) -> Iterator[str]:
        """Count one ontology and yield a line for every fault."""
        counts = self.counts
        counts['ontologies'] += 1
        write_ontology(spelt_out(axioms), IRI, path)
        kb = KnowledgeBase(IRI, axioms)
        start = time.process_time()
        try:
            consistent = kb.reason()
            reported = bool(kb.unsupported)
        except Exception as error:
            counts['crash'] += 1
            yield f'{seed}: crash: {type(error).__name__}: {error}'
            return
        finally:
            took = time.process_time() - start
            self.time += took
        if took > 2.0:
            yield f'{seed}: slow: {took:.1f} s'
        asked = list(questions(axioms))
        try:
            theirs, answers = self._answers(path, [words_for(fact) for fact in asked])
        except JavaReasonerError as error:
            late = 'no answer' in str(error)
            counts['no answer' if late else 'refused'] += 1
            if late:
                self.close()
            return
        missing = 'named' if reported else 'silent'
        if not theirs:
            counts['inconsistent'] += 1
        if consistent and not theirs:
            if self._judged(path, None) is True:
                counts['settled'] += 1
                return
            counts[missing] += 1
            if not reported:
                yield f'{seed}: silent: no contradiction found'
        elif theirs and not consistent:
            if self._judged(path, None) is False:
                counts['settled'] += 1
            else:
                counts['false inconsistency'] += 1
                yield f'{seed}: false inconsistency: {kb.explain_inconsistency()}'
        elif theirs:
            for axiom, answer in zip(asked, answers, strict=True):
                if answer == 'e':
                    continue
                counts['questions'] += 1
                ours = kb.holds(axiom)
                if ours == (answer == 't'):
                    counts['right'] += 1
                elif self._judged(path, words_for(axiom)) == ours:
                    counts['settled'] += 1
                elif ours:
                    counts['unsound'] += 1
                    yield f'{seed}: unsound: {axiom}'
                else:
                    counts[missing] += 1
                    if not reported:
                        yield f'{seed}: silent: {axiom}'

    def _answers(self, path: Path, asked: list[tuple[str, ...]]) -> tuple[bool, str]:
        reasoner = self._reasoner(self._kind)
        if reasoner.ask('load', str(path)) != 'ok':
            return False, ''
        return True, reasoner.ask_all(asked)

    def _judged(self, path: Path, words: tuple[str, ...] | None) -> bool | None:
        """Ask the other Java reasoner about a fact, or with None about consistency."""
        (other,) = (kind for kind in KINDS if kind != self._kind)
        try:
            judge = self._reasoner(other)
            consistent = judge.ask('load', str(path)) == 'ok'
            return consistent if words is None else judge.ask(*words) == 'true'
        except JavaReasonerError as error:
            if 'no answer' in str(error):
                self.close()
            return None

    def _reasoner(self, kind: str) -> JavaReasoner:
        if kind not in self._java:
            self._java[kind] = JavaReasoner(kind, timeout=self._seconds)
        return self._java[kind]

    def close(self) -> None:
        """End the JVMs; the next comparison starts others."""
        for reasoner in self._java.values():
            reasoner.close()
        self._java.clear()


def main() -> None:
    """Read the arguments and print the table."""
    parser = sized_parser(__doc__, quick='40 ontologies')
    parser.add_argument('--number', type=int, default=1000, help='how many ontologies')
    parser.add_argument('--first', type=int, default=0, help='the first seed')
    parser.add_argument('--cases', type=float, default=0.2, help='share of disjunctive classes')
    parser.add_argument('--special', type=float, default=0.0, help='share of top and bottom')
    parser.add_argument('--dense', action='store_true', help='few names and few kinds of axioms')
    parser.add_argument('--kind', choices=KINDS, default='hermit')
    parser.add_argument('--seconds', type=float, default=30.0, help='longest time for an ontology')
    arguments = parser.parse_args()
    if why := absent():
        skip(why)
    number = arguments.size.of(arguments.number, 40, 1)
    comparison = Comparison(arguments.kind, arguments.seconds)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'random.owl'
        for seed in range(arguments.first, arguments.first + number):
            if arguments.dense:
                axioms = dense_axioms(seed)
            else:
                axioms = drawn_axioms(seed, arguments.cases, arguments.special)
            for line in comparison.compare(seed, axioms, path):
                print(line, flush=True)
    comparison.close()
    for name in (*COLUMNS, *FAULTS):
        print(f'{name:20} {comparison.counts[name]:8}')
    print(f'{"seconds here":20} {comparison.time:8.1f}')


if __name__ == '__main__':
    main()
