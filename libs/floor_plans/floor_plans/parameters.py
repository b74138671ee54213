"""A place as the parameters of a ROS node, or any other mapping: its sections, each read alone.

`checked_plan` reads all of them. A node that needs the zones alone, or the stations, reads those;
an error is a `PlaceError` that begins with the parameter. Tables are nested mappings: `tables_of`
makes them of flat names such as `map.R1`.
"""

from floor_plans.description import checked_plan as checked_plan
from floor_plans.description import map_file_beside as map_file_beside
from floor_plans.fleet import members_of as members_of
from floor_plans.patrol_rules import CLASSES as CLASSES
from floor_plans.patrol_rules import patrol_rules as patrol_rules
from floor_plans.rooms import GEOMETRY_KEYS as GEOMETRY_KEYS
from floor_plans.rooms import PATROL_KEYS as PATROL_KEYS
from floor_plans.rooms import PATROL_TABLES as PATROL_TABLES
from floor_plans.rooms import PLACE_KEYS as PLACE_KEYS
from floor_plans.rooms import PLACE_TABLES as PLACE_TABLES
from floor_plans.rooms import ZONE_TABLES as ZONE_TABLES
from floor_plans.rooms import description_of as description_of
from floor_plans.rooms import edited_place as edited_place
from floor_plans.rooms import make_place as make_place
from floor_plans.rooms import nested as nested
from floor_plans.rooms import place_from as place_from
from floor_plans.rooms import problem_in_name as problem_in_name
from floor_plans.rooms import tables_of as tables_of
from floor_plans.stations import AT_STATION as AT_STATION
from floor_plans.stations import station_at as station_at
from floor_plans.stations import stations_in as stations_in
from floor_plans.stations import stations_of as stations_of
from floor_plans.zones import NO_ZONES as NO_ZONES
from floor_plans.zones import zones_from as zones_from
