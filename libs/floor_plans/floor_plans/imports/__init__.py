"""A place made of what there is already: a robot's map, a drawn building, another program's graph.

`import_place` looks at the file, makes the place, writes and draws it. Read from the bottom up:
`rmf_building` draws a level of Open-RMF's building.yaml as a map, `graphs` reads graphs of
patrolling_sim, of Nav2's route server and of Open-RMF, `plan_photo` finds the walls of a
photographed plan, `renewal` lays a newer map over an older one, `place_import` does the rest.
"""

from floor_plans.imports.graphs import SUFFIXES as SUFFIXES
from floor_plans.imports.place_import import ImportReport as ImportReport
from floor_plans.imports.place_import import ImportRequest as ImportRequest
from floor_plans.imports.place_import import import_place as import_place
from floor_plans.imports.place_import import is_levels as is_levels
from floor_plans.imports.plan_photo import PlanPhoto as PlanPhoto
from floor_plans.imports.renewal import changes_since as changes_since
