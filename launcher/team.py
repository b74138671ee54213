"""The parts of a run of `launch.py`; what is in each, `surveillance_runtime.team` says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from launcher.run import Run
from surveillance_runtime.profile import ProfileFile
from surveillance_runtime.run_parameters import place_file
from surveillance_runtime.team import Choice, TeamPart, team_parts


@dataclass(frozen=True, kw_only=True)
class Part(TeamPart):
    """A part with what is asked of it.

    Attributes:
        run: What is asked of its nodes; its namespace is theirs.
    """

    run: Run


def parts(run: Run, config: Path, robot: ProfileFile) -> tuple[Part, ...]:
    """Return the parts of a run, what is shared first.

    Raises:
        ValueError: A word of `only` or `without` names nothing, or nothing is left to start.
    """
    monitored = robot.profile.is_monitored
    choice = Choice(
        run.only,
        run.without,
        lambda only, without: replace(run, only=only, without=without).nodes(monitored=monitored),
        lambda only: replace(run, only=only).observers(),
    )
    path = place_file(config, run.behaviour, run.place)
    found = team_parts(path, run.robots, robot.profile.body.reach, run.namespace, choice)
    return tuple(
        Part(
            **vars(part),
            run=replace(run, namespace=part.namespace, robot=part.profile or run.robot),
        )
        for part in found
    )
