"""An incremental reasoner for the Horn part of OWL 2 with DL-safe SWRL rules.

What it derives is sound. Axioms become Horn clauses (`translation`, `clauses`, `simplify`); what
classes alone imply is completed (`classification`); the clauses run as compiled joins (`joins`,
`network`) in an incremental engine (`engine`, `cardinality`, `equality`, `difference`,
`threshold_rules`) that explains what it holds (`proofs`, `explanation`). Values are compared by
`datatypes` and `swrl_builtins`. What would need reasoning by cases is reported by
`KnowledgeBase.unsupported`. `java_reasoning` runs HermiT or Pellet beside it.
"""
