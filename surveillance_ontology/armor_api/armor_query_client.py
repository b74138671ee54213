"""The query methods of a client, under armor_py_api's name."""

from armor_service.client import Query

ArmorQueryClient = Query

__all__ = ['ArmorQueryClient']
