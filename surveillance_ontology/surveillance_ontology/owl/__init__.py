"""OWL's own terms as records: axioms, expressions, entities."""
