"""OWL's own terms as frozen records.

- `axioms`: axioms and SWRL rules; `expressions`: literals, data ranges, class expressions, atoms;
- `vocabulary`: the names that OWL, RDF and XML Schema give;
- `axiom_text`: axioms in words; `entities`: what a record mentions, and renaming;
- `assertions`: an indexed set of axioms that knows what changed.
"""
