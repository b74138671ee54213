"""The rooms of a map: where one ends and the next begins, found from what stands in the building.

Read from the bottom up: `openings` finds the lines along which a building may be cut (a wall goes
on behind a gap, two walls end opposite each other, a passage is narrow), `joining` takes away the
cuts that part no two rooms, `segmentation` does all of it for a map, `proposal` makes a place of
the result: rooms and doors with names, a point in each room that the robot can reach.
"""

from floor_plans.map_rooms.proposal import LeftOut as LeftOut
from floor_plans.map_rooms.proposal import Proposal as Proposal
from floor_plans.map_rooms.proposal import propose as propose
from floor_plans.map_rooms.segmentation import Segmentation as Segmentation
from floor_plans.map_rooms.segmentation import segment as segment
