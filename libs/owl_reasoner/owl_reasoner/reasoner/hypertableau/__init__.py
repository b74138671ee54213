"""Reasoning by cases: the hypertableau calculus of Motik, Shearer and Horrocks (JAIR 36, 2009).

`clauses` turns axioms into rules with alternatives, `model` holds what is known with the choices it
rests on, `search` completes it, `rule_joins` and `values` apply rules about named individuals and
about data, and `entailment` asks what holds in every model.
"""
