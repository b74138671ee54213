"""Whether justifications suffice, and whether every axiom in them is needed: HermiT judges.

    python benchmarks/justifications.py [FILE ...] [--random 100] [--facts 30]

Of each ontology (files in any format that is read, and random ones, see `random_agreement.py`)
some derived facts and subclasses are drawn. A justification is sufficient where HermiT derives the
fact from it alone, and minimal where HermiT does so from no part that lacks one axiom.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.java_reasoner import JavaReasoner, JavaReasonerError, absent  # noqa: E402
from benchmarks.random_agreement import IRI, drawn_axioms, spelt_out, words_for  # noqa: E402
from surveillance_ontology import KnowledgeBase, read_ontology, write_ontology  # noqa: E402
from surveillance_ontology.owl.axiom_text import axiom_text  # noqa: E402
from surveillance_ontology.owl.axioms import (  # noqa: E402
    Axiom,
    Declaration,
    Import,
    SubClassOf,
)
from surveillance_ontology.owl.entities import entities_of  # noqa: E402
from surveillance_ontology.owl.vocabulary import THING  # noqa: E402

COLUMNS = ('facts', 'sufficient', 'minimal', 'not judged')


class Judge:
    """Asks HermiT what follows from a few axioms."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._java = JavaReasoner('hermit')

    def derives(self, axioms: Iterable[Axiom], fact: Axiom) -> bool | None:
        """Tell whether a fact follows from axioms; None where HermiT does not say."""
        axioms = list(axioms)
        named = {entity for axiom in (*axioms, fact) for entity in entities_of(axiom)}
        declared = [Declaration(*entity) for entity in named if entity[0] != 'annotated']
        write_ontology(spelt_out([*declared, *axioms]), IRI, self._path)
        try:
            consistent = self._java.ask('load', str(self._path)) == 'ok'
            return not consistent or self._java.ask(*words_for(fact)) == 'true'
        except JavaReasonerError as error:
            if 'no answer' in str(error):
                self._java = JavaReasoner('hermit')
            return None

    def close(self) -> None:
        """End the JVM."""
        self._java.close()


def derived(kb: KnowledgeBase, most: int, draw: random.Random) -> list[Axiom]:
    """Return some facts and subclasses that are derived and not asserted."""
    classes = sorted({iri for a in kb.axioms() for kind, iri in entities_of(a) if kind == 'class'})
    below = [SubClassOf(one, sup) for one in classes for sup in kb.superclasses(one)]
    facts = [*kb.derived_facts(), *(a for a in below if a.sup != THING and a not in kb)]
    return draw.sample(sorted(facts, key=repr), min(most, len(facts)))


def judged(axioms: Iterable[Axiom], judge: Judge, most: int, counts: Counter[str]) -> Iterator[str]:
    """Count the justifications of one ontology and yield a line for every fault."""
    kb = KnowledgeBase(IRI, (a for a in axioms if not isinstance(a, Import)))
    if not kb.reason():
        return
    for fact in derived(kb, most, random.Random(0)):
        needed = kb.justification(fact)
        enough = judge.derives(needed, fact)
        if enough is None:
            counts['not judged'] += 1
            continue
        counts['facts'] += 1
        counts['sufficient'] += enough
        loose = [a for a in needed if judge.derives((b for b in needed if b is not a), fact)]
        counts['minimal'] += not loose
        if not enough:
            yield f'  {axiom_text(fact)}: {len(needed)} axioms do not suffice'
        elif loose:
            yield f'  {axiom_text(fact)}: not needed: {axiom_text(loose[0])}'


def main() -> None:
    """Read the arguments and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('files', nargs='*', type=Path, help='ontologies')
    parser.add_argument('--random', type=int, default=0, help='how many random ontologies')
    parser.add_argument('--first', type=int, default=0, help='the first seed')
    parser.add_argument('--facts', type=int, default=30, help='so many facts of each ontology')
    arguments = parser.parse_args()
    if why := absent():
        parser.exit(1, f'{why}\n')
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
