"""What a run may be asked for, whoever starts it.

`launch.py` has these options as `--name`, the launch file for an installed ROS as `name:=`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from surveillance_runtime import node_table

BUILT_IN_ROBOT = 'built_in'
KINEMATIC, MUJOCO, NO_SIMULATOR = 'kinematic', 'mujoco', 'none'
SIMULATORS = (KINEMATIC, MUJOCO, NO_SIMULATOR)


@dataclass(frozen=True)
class RunOption:
    """One of the options.

    Attributes:
        name: As it is written.
        default: What counts where the user says nothing.
        help: One sentence.
        choices: The only values; empty for any.
    """

    name: str
    default: str
    help: str
    choices: Sequence[str] = ()


_SWITCH = ('false', 'true')
OPTIONS = {
    option.name: option
    for option in (
        RunOption(
            'mode',
            node_table.DEFAULT_MODE,
            'what drives: a simulation, your ROBOT, random values, or you at the console',
            node_table.MODES,
        ),
        RunOption(
            'behaviour',
            node_table.DEFAULT_BEHAVIOUR,
            'surveillance starts with a map, patrol learns it from markers',
            node_table.BEHAVIOURS,
        ),
        RunOption(
            'map',
            '',
            'the place (default: config/seven_rooms.yaml, for patrol config/patrol_world.yaml)',
        ),
        RunOption(
            'robot',
            BUILT_IN_ROBOT,
            "the robot's profile: its topics, frames, size, speeds; a name of config/robots or a "
            'file like those',
        ),
        RunOption(
            'robots',
            '',
            'how many robots patrol the place together, robot1, robot2, ...; the table `robots` of '
            'a place names others (default: as the place says, else one)',
        ),
        RunOption(
            'simulator',
            KINEMATIC,
            'what simulates the robot in mode SIMULATED: kinematic, which may run faster than real '
            'time; mujoco: physics, wheels that slip (needs the package mujoco); none: another '
            'program',
            SIMULATORS,
        ),
        RunOption(
            'params',
            '',
            'a ROS parameter file; it overrides config/parameters.yaml, the robot and the place',
        ),
        RunOption(
            'processes',
            node_table.FEW,
            'how the nodes share processes: few, so that what guards the base, what knows and what '
            'records go on without the others; one-each; or one for all that work',
            node_table.COMPOSITIONS,
        ),
        RunOption('namespace', '', 'prefix of all ROS names, for a second robot'),
        RunOption(
            'log_level', 'info', 'lowest severity that the nodes print', node_table.LOG_LEVELS
        ),
        RunOption(
            'only',
            '',
            'start only these nodes; the others run elsewhere; of a fleet also robot1, '
            'robot1/NODE or shared',
        ),
        RunOption('without', '', 'do not start these nodes; they run elsewhere'),
        RunOption(
            'remap', '', 'rename a topic, service or action of all nodes, as -r of ros2 run does'
        ),
        RunOption(
            'alarm', '', 'run this when the robot needs a person; the last argument says why'
        ),
        RunOption(
            'notify', '', 'whom else to tell: webhooks, MQTT, e-mail, commands (notify.yaml)'
        ),
        RunOption(
            'network',
            '',
            'what the nodes are open to: localhost; open: the networks of this machine, whose '
            'other nodes can then control the robot; or NAME.xml, a profile of Fast DDS (default: '
            "localhost, or what the shell's variables say)",
        ),
        RunOption('record', '', 'folder for the files of runs'),
        RunOption(
            'watch',
            '',
            'rules of what a person wants to know of, watch.yaml; starts the observer',
        ),
        RunOption(
            'stage',
            '',
            'what happens in the simulated place at which times, stage.yaml; the truth is written '
            "to the run's truth.jsonl",
        ),
        RunOption('web', 'false', 'serve a live page; its address is printed', _SWITCH),
        RunOption(
            'web_control',
            'false',
            'like --web, with controls for whoever has the printed token',
            _SWITCH,
        ),
        RunOption(
            'web_address',
            '',
            'address of the page; implies --web; other addresses than 127.0.0.1 need the printed '
            'token even to look',
        ),
        RunOption(
            'web_origin',
            '',
            'what browsers know the page by behind a TLS proxy, as https://robot.example.org; '
            'implies --web; then everybody needs the printed token',
        ),
    )
}


def left_out(simulator: str, without: Sequence[str]) -> tuple[str, ...]:
    """Return the nodes that are not started: those asked for, and a simulator that is none."""
    return (*without, 'simulator') if simulator == NO_SIMULATOR else tuple(without)
