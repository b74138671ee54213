"""The robot's knowledge: the ontology's server and the map builder, as ROS nodes.

- `armor_server_node`: the library `armor_service` behind ARMOR's two services;
- `ontology_map_builder_node`, `map_keeper`: rooms and doors of a place, kept in the ontology;
- `patrol_vocabulary`: the one module that spells the words of the patrol; begin there;
- `map_ontology`: the map's half, rooms and doors; `robot_ontology`: what a robot tells and asks;
- `armor_client`: directives from a node; `armor_api`, beside this package, from a plain program.
"""
