"""What outlives the process: each reference as an owlready2 World in a file of its own.

Begin with `store.Store`, then `world_file` (one reference's file: transactions, what is remembered
beside the axioms, foreign changes) and `world_ontology` (axioms as quads, both ways). `spill` takes
what cannot be written while somebody else has the file, `salvage` what is left of a damaged one,
and `journal_conversion` reads stores of before.
"""
