"""The utils methods of a client, under armor_py_api's name."""

from armor_service.client import Utils

ArmorUtilsClient = Utils

__all__ = ['ArmorUtilsClient']
