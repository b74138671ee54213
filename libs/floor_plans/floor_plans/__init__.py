"""A place: its rooms and doors, its file, its walls on a grid, its picture.

`Place` is what the nodes share: rooms, the doors that join them, a point in each. `FloorPlan` adds
what the place's file says of walls, doors and markers, and `Regions` which room a point lies in.
`read_place_file` reads and checks a file;
`occupancy_grid` is a map's cells, `plan_grid` draws a floor plan on them, `drawing` draws places.
"""

from floor_plans.description import PlaceFile as PlaceFile
from floor_plans.description import checked_plan as checked_plan
from floor_plans.description import read_place_file as read_place_file
from floor_plans.floor_plan import FloorPlan as FloorPlan
from floor_plans.regions import Regions as Regions
from floor_plans.regions import check_passable as check_passable
from floor_plans.rooms import Place as Place
from floor_plans.rooms import PlaceError as PlaceError
from floor_plans.rooms import Position as Position
from floor_plans.rooms import description_of as description_of
from floor_plans.rooms import edited_place as edited_place
from floor_plans.rooms import make_place as make_place
from floor_plans.rooms import problem_in_name as problem_in_name
