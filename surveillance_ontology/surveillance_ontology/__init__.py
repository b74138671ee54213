"""OWL ontology service with ARMOR's interface, its reasoner, and the map builder."""
