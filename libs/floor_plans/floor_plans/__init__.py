"""A building as rooms, doors and walls: read, found in a robot's map, drawn, edited.

Begin with `read_place`: it reads a place's file, checks all of it, and returns a `PlaceFile` with
the rooms (`Place`) and the building around them (`FloorPlan`). `RoomMap` says which room a point
lies in. `map_rooms.propose` finds rooms and doors in a map.

Public modules: `drawing` (pictures of places), `editor` (changes, with undo), `facts`
(what there is to say), `filter_masks` (zones for Nav2), `fleet` (several robots of a place),
`imports` (places out of maps, buildings and graphs),
`map_rooms` (finds rooms and doors), `occupancy_grid` (cells and what is measured on them),
`occupancy_map` (maps in map_server's format), `parameters` (a place as parameters),
`shapes` (points, lines, boxes), `visibility` (what is in view from a point), `writing` (the text of
a place's file).
"""

from floor_plans.description import PlaceFile as PlaceFile
from floor_plans.description import read_place as read_place
from floor_plans.floor_plan import Door as Door
from floor_plans.floor_plan import FloorPlan as FloorPlan
from floor_plans.floor_plan import Marker as Marker
from floor_plans.occupancy_grid import Grid as Grid
from floor_plans.patrol_rules import PatrolRules as PatrolRules
from floor_plans.room_map import ROBOT_RADIUS as ROBOT_RADIUS
from floor_plans.room_map import RoomMap as RoomMap
from floor_plans.rooms import Place as Place
from floor_plans.rooms import PlaceError as PlaceError
from floor_plans.stations import Station as Station
from floor_plans.zones import Zone as Zone
from floor_plans.zones import Zones as Zones
