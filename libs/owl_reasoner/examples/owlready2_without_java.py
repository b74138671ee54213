"""Reason in an owlready2 program without Java: classes, values, an `Imp` rule, and a contradiction.

python examples/owlready2_without_java.py
"""

# ruff: noqa: N801, RUF012 - classes as users of owlready2 write them
from __future__ import annotations

import owlready2
from owlready2 import AllDisjoint, FunctionalProperty, Imp, Thing

from owl_reasoner import sync_reasoner_native

world = owlready2.World()
onto = world.get_ontology('http://example.org/tablets#')
with onto:

    class Drug(Thing):
        """What is sold in boxes of tablets."""

    class price(Drug >> float, FunctionalProperty):
        """Price of a box."""

    class tablets(Drug >> int, FunctionalProperty):
        """Tablets in a box."""

    class price_per_tablet(Drug >> float, FunctionalProperty):
        """Follows from the two."""

    class CheapDrug(Drug):
        """A definition: what costs at most 1 a tablet."""

        equivalent_to = [Drug & (price_per_tablet <= 1.0)]  # type: ignore[operator]

    rule = Imp()
    rule.set_as_rule(
        'Drug(?d), price(?d, ?p), tablets(?d, ?n), divide(?r, ?p, ?n) -> price_per_tablet(?d, ?r)'
    )
    aspirin = Drug('aspirin', price=5.0, tablets=10)

sync_reasoner_native(world)
print(aspirin, 'costs', aspirin.price_per_tablet, 'a tablet and is', *aspirin.is_a)

aspirin.price = 50.0
sync_reasoner_native(world)  # Only what changed; what follows no more is taken back.
print(aspirin, 'costs', aspirin.price_per_tablet, 'a tablet and is', *aspirin.is_a)

with onto:

    class Food(Thing):
        """Nothing is a drug and food."""

    AllDisjoint([Drug, Food])
    aspirin.is_a.append(Food)

try:
    sync_reasoner_native(world)
except owlready2.OwlReadyInconsistentOntologyError as error:
    print(error)
