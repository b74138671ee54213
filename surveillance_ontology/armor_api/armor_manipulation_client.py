"""The manipulation methods of a client, under armor_py_api's name."""

from surveillance_ontology.armor.client import Manipulation

ArmorManipulationClient = Manipulation

__all__ = ['ArmorManipulationClient']
