"""ARMOR-compatible ontology service and reasoner in Python, and the map builder of the surveillance robot."""
