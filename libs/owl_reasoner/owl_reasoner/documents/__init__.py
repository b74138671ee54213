"""Ontology documents: reading them into axioms and writing axioms as documents.

- `reading`, `writing`: the entry points, `read_ontology` and `write_ontology`;
- `rdf_xml`: a syntax to triples; `mapping`: triples to axioms;
- `functional_syntax`, `owl_xml`: syntaxes to constructs; `structural`: constructs to axioms;
- `triples`: axioms to triples.
"""
