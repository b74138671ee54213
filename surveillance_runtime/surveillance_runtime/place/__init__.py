"""A place: its rooms and doors, its file, its walls on a grid, its picture.

`Place` is what the nodes share: rooms, the doors that join them, a point in each. `FloorPlan` adds
what the place's file says of walls, doors and markers, and `Regions` which room a point lies in.
`read_place_file` reads and checks a file, `described_place` the parameters of a node;
`occupancy_grid` is a map's cells, `plan_grid` draws a floor plan on them, `drawing` draws places.
"""

from surveillance_runtime.place.description import PlaceFile as PlaceFile
from surveillance_runtime.place.description import checked_plan as checked_plan
from surveillance_runtime.place.description import described_place as described_place
from surveillance_runtime.place.description import read_place_file as read_place_file
from surveillance_runtime.place.floor_plan import FloorPlan as FloorPlan
from surveillance_runtime.place.regions import Regions as Regions
from surveillance_runtime.place.regions import check_passable as check_passable
from surveillance_runtime.place.rooms import Place as Place
from surveillance_runtime.place.rooms import PlaceError as PlaceError
from surveillance_runtime.place.rooms import Position as Position
from surveillance_runtime.place.rooms import description_of as description_of
from surveillance_runtime.place.rooms import edited_place as edited_place
from surveillance_runtime.place.rooms import make_place as make_place
from surveillance_runtime.place.rooms import problem_in_name as problem_in_name
