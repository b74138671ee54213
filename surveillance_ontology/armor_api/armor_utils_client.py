"""The utils methods of a client, under armor_py_api's name."""

from surveillance_ontology.armor.client import Utils

ArmorUtilsClient = Utils

__all__ = ['ArmorUtilsClient']
