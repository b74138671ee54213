"""The query methods of a client, under armor_py_api's name."""

from surveillance_ontology.armor.client import Query

ArmorQueryClient = Query

__all__ = ['ArmorQueryClient']
