"""Reasoning about classes from their consequences (Simancik, Kazakov and Horrocks, IJCAI 2011).

`contexts` completes what an individual of certain classes is; `classification` makes the hierarchy
and the program of clauses from it.
"""
