"""A drop-in for armor_py_api: its modules, classes and method names, for ROS 2 and this server.

    from armor_api.armor_client import ArmorClient

    client = ArmorClient('planner', 'map')
    client.utils.load_ref_from_file('map.owl', 'http://bnc/exp-rob-lab/2022-23')
    client.query.ind_b2_class('ROOM')

A client owns the node and the thread that it needs: a script calls neither ``rclpy.init`` nor
``spin``. A node that is spun anyway uses `surveillance_ontology.armor_client.ArmorClient`, whose
methods can be awaited in its callbacks. docs/how-to/from_armor.md says what changes in a program.
"""

from armor_api.armor_client import ArmorClient
from armor_api.armor_exceptions import (
    ArmorPyException,
    ArmorServiceCallError,
    ArmorServiceInternalError,
)

__all__ = [
    'ArmorClient',
    'ArmorPyException',
    'ArmorServiceCallError',
    'ArmorServiceInternalError',
]
