"""What outlives the process: each reference as an owlready2 World in a file of its own.

Begin with `store.Store`, then `world_file` (one reference's file, composed of what follows):
`world_connection` (tables, triggers, transactions, copies), `unwritten` (what the file lacks, and
what it remembers beside the axioms), `foreign_writes` (what other programs wrote) and
`write_failure`. `world_ontology` has axioms as quads, both ways. `spill` takes what cannot be
written while somebody else has the file, `salvage` what is left of a damaged one, and
`journal_conversion` reads stores of before.
"""
