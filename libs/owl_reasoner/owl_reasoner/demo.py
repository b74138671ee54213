"""A house of three places: what follows from a dozen statements, why, and what a change changes.

python -m owl_reasoner.demo
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from owl_reasoner import KnowledgeBase, read_ontology
from owl_reasoner.owl.axioms import ClassAssertion, DataPropertyAssertion
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD, local_name

IRI = 'http://example.org/house'
HOUSE = """
Prefix: : <http://example.org/house#>
Prefix: swrlb: <http://www.w3.org/2003/11/swrlb#>
Ontology: <http://example.org/house>

Class: Corridor
    EquivalentTo: Room and (hasDoor min 2 Door)
Class: Urgent
    SubClassOf: Room
ObjectProperty: hasDoor
    Domain: Room
    Range: Door
ObjectProperty: leadsTo
DataProperty: age

Rule: hasDoor(?a, ?d), hasDoor(?b, ?d), DifferentFrom(?a, ?b) -> leadsTo(?a, ?b)
Rule: age(?r, ?t), swrlb:greaterThan(?t, 60) -> Urgent(?r)

Individual: Hall
    Facts: hasDoor D1, hasDoor D2, age 10
Individual: Kitchen
    Facts: hasDoor D1, age 90
Individual: Office
    Facts: hasDoor D2, age 20
DifferentIndividuals: Hall, Kitchen, Office
DifferentIndividuals: D1, D2
"""


def named(name: str) -> str:
    """Return the IRI of a local name."""
    return f'{IRI}#{name}'


def main() -> None:
    """Reason over the house, ask why, change a fact, ask what a missing one lacks."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'house.omn'
        path.write_text(HOUSE)
        kb = KnowledgeBase(IRI, read_ontology(path, IRI).axioms)
    print(f'{len(kb)} statements, consistent: {kb.reason()}\n')
    for cls in ('Room', 'Corridor', 'Door', 'Urgent'):
        print(f'{cls:9}', ', '.join(sorted(map(local_name, kb.instances(named(cls))))))
    reached = kb.object_values(named('leadsTo'), named('Hall'))
    print('Hall leads to', ', '.join(sorted(map(local_name, reached))))

    corridor = kb.explain(ClassAssertion(named('Corridor'), named('Hall')))
    assert corridor is not None
    print(f'\nWhy is Hall a Corridor?\n{corridor.tree()}')

    print('\nSomebody looks into the kitchen, and its age is 5:')
    kb.change(
        [DataPropertyAssertion(named('age'), named('Kitchen'), Literal('5', XSD + 'integer'))],
        [DataPropertyAssertion(named('age'), named('Kitchen'), Literal('90', XSD + 'integer'))],
    )
    kb.reason()
    print('Urgent   ', ', '.join(sorted(map(local_name, kb.instances(named('Urgent'))))) or 'none')
    lacking = kb.explain_absence(ClassAssertion(named('Urgent'), named('Kitchen')))
    assert lacking is not None
    print(lacking.sentence())


if __name__ == '__main__':
    main()
