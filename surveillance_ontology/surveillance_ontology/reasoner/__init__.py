"""An incremental reasoner for the Horn part of OWL 2 with DL-safe SWRL rules.

What it derives is sound. It is complete for facts about named individuals over: atomic and complex
subclass and equivalence axioms whose left sides are built from names, intersection, union, some,
has-value, has-self, one-of and min cardinality, and whose right sides are built from names,
intersection, all, some, has-value and max cardinality and complement (as contradictions); property
axioms; keys; disjointness, equality, difference; datatypes by value; SWRL rules over named
individuals. What would need reasoning by cases (a union on a right side, a choice of which
individuals to identify) is reported by `unsupported`.
"""
