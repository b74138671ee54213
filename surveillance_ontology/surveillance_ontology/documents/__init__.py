"""Ontology documents: reading them into axioms and writing axioms as documents."""
