"""An incremental reasoner for OWL 2 DL with DL-safe SWRL rules.

What it derives is sound. Axioms become Horn clauses (`translation`, `clauses`, `simplify`); what
classes alone imply is completed (`consequence_based`); the clauses run as compiled joins (`joins`,
`join_network`) in an incremental engine (`engine`, `cardinality`, `equality`, `inequality`,
`threshold_rules`) that explains what it holds (`proofs`, `explanation`). Values are compared by
`datatypes` and `swrl_builtins`. What takes reasoning by cases is found by `hypertableau`
and added by `case_completion`; what is left out is reported by
`KnowledgeBase.unsupported`.
"""
