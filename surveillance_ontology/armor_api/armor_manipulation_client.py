"""The manipulation methods of a client, under armor_py_api's name."""

from armor_service.client import Manipulation

ArmorManipulationClient = Manipulation

__all__ = ['ArmorManipulationClient']
