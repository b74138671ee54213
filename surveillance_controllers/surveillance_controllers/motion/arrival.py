"""How a motion ends: in a place, or not where it should."""

from __future__ import annotations

import numpy as np

from surveillance_controllers.geometry.polyline import Points
from surveillance_controllers.manual import request_texts
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_runtime.action_server import GoalRun


class MotionFailed(Exception):
    """The robot did not get where it should; the text says why.

    Args:
        reason: One line.
        end: Where the robot is, shape (3,), metres; None when that is not known.
    """

    def __init__(self, reason: str, end: Points | None) -> None:
        super().__init__(reason)
        self.end = end


def nearest_place(knowledge: MapKnowledge, end: Points, reach: float, run: GoalRun) -> str:
    """The place whose point is nearest to where a motion ended.

    Args:
        knowledge: Map and ontology.
        end: Where the robot is, shape (3,), metres.
        reach: A place further away than this is not taken, metres.
        run: The goal that is carried out.

    Raises:
        MotionFailed: No place is within reach.
        KnowledgeError: Map or ontology do not answer.
    """
    places = knowledge.places(run.interrupt)
    gaps = {name: float(np.linalg.norm(end - at)) for name, at in places.items()}
    nearest = min(gaps, key=lambda name: gaps[name], default=None)
    if nearest is None or gaps[nearest] > reach:
        raise MotionFailed(
            f'the robot stopped at {request_texts.point(end)}: expected a place within {reach:g} m'
            + (f', {nearest} is {gaps[nearest]:.2f} m away' if nearest else ''),
            end,
        )
    return nearest
