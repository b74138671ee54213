"""The reasoner for programs that keep their ontologies in owlready2.

`quads` writes axioms into the quad store of a World and reads them from there; `reasoning` has
`sync_reasoner_native`, which takes the place of owlready2's `sync_reasoner_pellet` without Java.
"""
