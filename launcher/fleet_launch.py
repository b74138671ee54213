"""The parts of a run of `launch.py`; what is in each, `surveillance_runtime.fleet_parts` says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from launcher.run import Run
from surveillance_runtime import node_table
from surveillance_runtime.fleet_parts import Choice, TeamPart, team_parts
from surveillance_runtime.profile import ProfileFile
from surveillance_runtime.run_parameters import place_file


@dataclass(frozen=True, kw_only=True)
class RobotProcesses(TeamPart):
    """A part with what is asked of it.

    Attributes:
        run: What is asked of its nodes; its namespace is theirs, and it names no part of the fleet.
    """

    run: Run


def parts(run: Run, config: Path, robot: ProfileFile) -> tuple[RobotProcesses, ...]:
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
        RobotProcesses(
            **vars(part),
            run=replace(
                run,
                namespace=part.namespace,
                robot=part.profile or run.robot,
                only=[node.name for node in part.nodes],
                without=[],
            ),
        )
        for part in found
    )


def without_parts(run: Run) -> Run:
    """Return the run without the words that name parts of a fleet, and their nodes."""

    def kept(words: Sequence[str]) -> list[str]:
        return [word for word in words if word in node_table.BY_NAME]

    return replace(run, only=kept(run.only), without=kept(run.without))
