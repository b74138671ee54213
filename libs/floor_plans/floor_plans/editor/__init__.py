"""Editing a place: rooms cut and joined, doors, zones, points, rules; undone, checked and saved.

Read from the bottom up: `measures` measures on the floor (where a line meets walls, which part of a
room lies on which side), `operations` change what a place's file says, `editor` keeps the history,
checks each change as the file would be checked, and writes the file with its comments kept;
`changes` compares with an older place of the building.
"""

from floor_plans.editor.changes import PlaceChange as PlaceChange
from floor_plans.editor.changes import changes_between as changes_between
from floor_plans.editor.editor import PlaceEditor as PlaceEditor
