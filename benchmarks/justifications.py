"""Whether justifications suffice, and whether every axiom in them is needed.

    python benchmarks/justifications.py [FILE ...] [--random 100] [--facts 30]

Of each ontology (files in any format that is read, and random ones, see `random_agreement.py`)
some derived facts and subclasses are drawn, or the contradiction where there is one. A
justification is sufficient where HermiT derives the fact from it alone, and minimal where HermiT
does so from no part that lacks one axiom; where HermiT does not confirm that, Pellet decides.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.random_agreement import IRI, drawn_axioms, spelt_out, words_for
from benchmarks.sizes import Size, sized_parser, skip
from libs.owl_reasoner.tests.java_reasoner import JavaReasoner, JavaReasonerError, absent
from owl_reasoner import KnowledgeBase, read_ontology, write_ontology
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import (
    Axiom,
    Declaration,
    Import,
    SameIndividual,
    SubClassOf,
)
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.vocabulary import THING

COLUMNS = ('facts', 'sufficient', 'minimal', 'not judged')


class Judge:
    """Asks HermiT what follows from a few axioms, and Pellet where HermiT contradicts."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._java: dict[str, JavaReasoner] = {}

    def confirms(self, axioms: Iterable[Axiom], fact: Axiom | None, expected: bool) -> bool | None:
        """Tell whether either of them says that a fact follows, or does not; None: neither can.

        Args:
            axioms: The only axioms that are given.
            fact: The fact; None for a contradiction.
            expected: Whether it should follow.
        """
        axioms = list(axioms)
        asked = axioms if fact is None else [*axioms, fact]
        named = {entity for axiom in asked for entity in entities_of(axiom)}
        declared = [Declaration(*entity) for entity in named if entity[0] != 'annotated']
        write_ontology(spelt_out([*declared, *axioms]), IRI, self._path)
        first = self._answer('hermit', fact)
        if first == expected:
            return True
        second = self._answer('pellet', fact)
        return None if first is None and second is None else second == expected

    def _answer(self, kind: str, fact: Axiom | None) -> bool | None:
        java = self._java.get(kind) or JavaReasoner(kind)
        self._java[kind] = java
        try:
            consistent = java.ask('load', str(self._path)) == 'ok'
            if fact is None or not consistent:
                return not consistent
            return java.ask(*words_for(fact)) == 'true'
        except JavaReasonerError as error:
            if 'no answer' in str(error):
                del self._java[kind]
            return None

    def close(self) -> None:
        """End the JVMs."""
        for java in self._java.values():
            java.close()


def derived(kb: KnowledgeBase, most: int, draw: random.Random) -> list[Axiom]:
    """Return some facts and subclasses that are derived and not asserted."""
    classes = sorted({iri for a in kb.axioms() for kind, iri in entities_of(a) if kind == 'class'})
    below = [SubClassOf(one, sup) for one in classes for sup in kb.superclasses(one)]
    facts = [*kb.derived_facts(), *(a for a in below if a.sup != THING and a not in kb)]
    asked = [a for a in facts if not isinstance(a, SameIndividual) or len(a.individuals) == 2]
    return draw.sample(sorted(asked, key=repr), min(most, len(asked)))


def judged(axioms: Iterable[Axiom], judge: Judge, most: int, counts: Counter[str]) -> Iterator[str]:
    """Count the justifications of one ontology and yield a line for every fault."""
    kb = KnowledgeBase(IRI, (a for a in axioms if not isinstance(a, Import)))
    facts: list[Axiom | None] = [None]
    if kb.reason():
        facts = [*derived(kb, most, random.Random(0))]
    for fact in facts:
        needed = kb.justification(fact)
        enough = judge.confirms(needed, fact, True)
        if enough is None:
            counts['not judged'] += 1
            continue
        counts['facts'] += 1
        counts['sufficient'] += enough
        parts = {axiom: [a for a in needed if a is not axiom] for axiom in needed}
        loose = [a for a, part in parts.items() if judge.confirms(part, fact, False) is False]
        counts['minimal'] += not loose
        said = 'contradiction' if fact is None else axiom_text(fact)
        if not enough:
            yield f'  {said}: {len(needed)} axioms do not suffice'
        elif loose:
            yield f'  {said}: not needed: {axiom_text(loose[0])}'


def main() -> None:
    """Read the arguments and print the table."""
    parser = sized_parser(__doc__)
    parser.add_argument('files', nargs='*', type=Path, help='ontologies')
    parser.add_argument('--random', type=int, default=0, help='how many random ontologies')
    parser.add_argument('--first', type=int, default=0, help='the first seed')
    parser.add_argument('--facts', type=int, default=30, help='so many facts of each ontology')
    arguments = parser.parse_args()
    if why := absent():
        skip(why)
    if arguments.size is Size.SMOKE:
        arguments.random, arguments.facts = 1, 1
    seeds = range(arguments.first, arguments.first + arguments.random)
    with tempfile.TemporaryDirectory() as folder:
        judge = Judge(Path(folder) / 'part.owl')
        sources = [(path.name, [read_ontology(path, IRI).axioms]) for path in arguments.files]
        if seeds:
            sources.append((f'{len(seeds)} random', [drawn_axioms(seed) for seed in seeds]))
        print(f'{"":24}' + ''.join(f'{name:>12}' for name in COLUMNS), flush=True)
        for name, ontologies in sources:
            counts: Counter[str] = Counter()
            for axioms in ontologies:
                for line in judged(axioms, judge, arguments.facts, counts):
                    print(line, flush=True)
            print(f'{name:24}' + ''.join(f'{counts[one]:12}' for one in COLUMNS), flush=True)
        judge.close()


if __name__ == '__main__':
    main()
