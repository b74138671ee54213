"""Navigation measured: planning beside its peers, one step of control, and the whole stack's speed.

    python benchmarks/navigation.py [--quick] [SECTION ...]

The sections are planning, control, people, kidnaps, silence, stack, pace and times; all by default.
Every figure of planning stands beside its peers' from the same run.
"""

from __future__ import annotations

import itertools
import json
import logging
import math
import os
import random
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from geometry_msgs.msg import Twist
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from skimage.graph import MCP_Geometric

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import regular_places
from benchmarks.driven_robot import DrivenRobot
from benchmarks.processes import cpu_seconds, end_processes
from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from benchmarks.whole_stack import ROOT, Stack, ros_arguments
from floor_plans import Grid
from launcher.run import Run
from launcher.run_processes import command, node_environ
from lidar_navigation import Drive, DriveState, GridPlanner, Navigator, PlanningParameters, geometry
from lidar_navigation.geometry import Scan
from patrol_policy.battery import PERCENTILE_99
from surveillance_behaviour.learned_times import LegTimes
from surveillance_runtime import node_table
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.people import People, PeopleModel
from surveillance_simulation.world.simulated_place import SimulatedPlace, read_simulated_place

Mask = npt.NDArray[np.bool_]


def print_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a title and a table below it."""
    print(f'\n{title}\n{table([head, *rows])}')


def median_ms(work: Callable[[], Any], budget: float) -> float:
    """Return the median CPU time of a call in milliseconds, within a budget of seconds."""
    times: list[float] = []
    end = time.perf_counter() + budget
    while not times or (time.perf_counter() < end and len(times) < 15):
        begun = time.process_time()
        work()
        times.append((time.process_time() - begun) * 1e3)
    return statistics.median(times)


def grid_of(side: int) -> tuple[Grid, npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return a map of about side x side cells full of rooms, and two of its opposite corners."""
    rooms = max(2, round(side / 90))
    world = SimulatedPlace.from_parameters(regular_places.grid(rooms, rooms))
    cell = rooms * regular_places.ROOM / side
    drawn = world.plan.grid(cell, margin=0.0)
    half = regular_places.ROOM / 2
    first = np.array([half, half])
    return drawn, first, rooms * 2 * half - first


def planning(size: Size) -> None:
    """Time and length of paths beside the bare library, networkx and an optimal reference."""
    rows = []
    for side in size.of((100, 200, 500, 1000, 1500, 2000), (100, 300, 1000), (100,)):
        grid, start, goal = grid_of(side)
        planner = GridPlanner(grid)
        cost = planner.cost.copy()
        first, last = (tuple(int(i) for i in grid.cells_of(p)[0]) for p in (start, goal))

        def search(cost: Any = cost, first: Any = first, last: Any = last) -> Any:
            bare = MCP_Geometric(cost)
            bare.find_costs([first], [last])
            return bare.traceback(last)

        budget = size.of(4.0, 1.0, 0.0)
        ours = median_ms(lambda p=planner, s=start, g=goal: p.plan(s, g), budget)
        library = median_ms(search, budget)
        path = planner.plan(start, goal)
        spots = itertools.cycle([path[len(path) // 2], path[len(path) // 3], path[0] + 9.0])

        def again(p: GridPlanner = planner, s: Any = start, g: Any = goal, at: Any = spots) -> Any:
            p.set_obstacles([next(at)])
            return p.plan(s, g)

        anew = median_ms(again, budget)
        planner.set_obstacles([])
        shortest = GridPlanner(grid, PlanningParameters(aversion=0.0)).plan(start, goal)
        free = cost > 0
        peer = '-'
        if side <= 300:
            peer = f'{median_ms(lambda f=free, a=first, b=last: _networkx(f, a, b), 0.0):.0f}'
        reference = '-'
        if side <= 500:
            best = _optimum(free, first, last) * grid.resolution  # type: ignore[arg-type]
            reference = f'{best:.2f}'
        bare_length = geometry.length(grid.centres_of(np.array(search())))
        rows.append(
            (
                f'{grid.cells.shape[1]}x{grid.cells.shape[0]}',
                f'{ours:.1f}',
                f'{library:.1f}',
                f'{ours / library:.2f}',
                f'{anew:.1f}',
                peer,
                f'{geometry.length(path):.2f}',
                f'{geometry.length(shortest):.2f}',
                f'{bare_length:.2f}',
                reference,
            )
        )
    print_table(
        'Planning from corner to corner, median CPU time; obstacle: with one that is new.\n'
        'Length in metres: ours, which keeps away '
        'from walls;\nwith `aversion` 0; of the bare search on the same costs; the optimum over 32 '
        'directions.',
        (
            'cells',
            'ours ms',
            'MCP ms',
            'ratio',
            'obstacle',
            'nx ms',
            'ours',
            'short',
            'MCP',
            'optimum',
        ),
        rows,
    )


def _networkx(free: Mask, first: tuple[int, int], last: tuple[int, int]) -> float:
    import networkx  # takes its time, and tests that use this module do without

    graph = networkx.Graph()
    for offset, length in (((0, 1), 1.0), ((1, 0), 1.0), ((1, 1), 2**0.5), ((1, -1), 2**0.5)):
        both, there = _pairs(free, offset)
        graph.add_weighted_edges_from(
            (int(a), int(b), length) for a, b in zip(both, there, strict=True)
        )
    columns = free.shape[1]
    source, target = (row * columns + column for row, column in (first, last))
    return float(networkx.dijkstra_path_length(graph, source, target))


def _optimum(free: Mask, first: tuple[int, int], last: tuple[int, int]) -> float:
    """Return the length in cells of the shortest path over 32 directions through free cells."""
    origins, ends, lengths = [], [], []
    for offset in _directions():
        both, there = _pairs(free, offset)
        origins.append(both)
        ends.append(there)
        lengths.append(np.full(len(both), np.hypot(*offset)))
    size, columns = free.size, free.shape[1]
    network = coo_array(
        (np.concatenate(lengths), (np.concatenate(origins), np.concatenate(ends))), (size, size)
    ).tocsr()
    source, target = (row * columns + column for row, column in (first, last))
    return float(dijkstra(network, directed=False, indices=source)[target])


def _directions() -> Iterator[tuple[int, int]]:
    for row in range(4):
        for column in range(-3, 4):
            coprime = np.gcd(row, abs(column)) == 1
            if coprime and (row > 0 or column > 0) and max(row, abs(column)) <= 3:
                yield row, column


def _pairs(free: Mask, offset: tuple[int, int]) -> tuple[Any, Any]:
    """Return the cells (numbers) from which a step leads through free cells, and where to."""
    rows, columns = free.shape
    steps = 8 * max(abs(offset[0]), abs(offset[1]))
    covered = {
        (round(offset[0] * step / steps), round(offset[1] * step / steps))
        for step in range(steps + 1)
    }
    height, width = rows - offset[0], columns - abs(offset[1])
    west = max(0, -offset[1])
    clear = np.ones((height, width), bool)
    for row, column in covered:
        clear &= free[row : row + height, west + column : west + column + width]
    y, x = np.nonzero(clear)
    numbers = y * columns + x + west
    return numbers, numbers + offset[0] * columns + offset[1]


def control(size: Size) -> None:
    """Time of one step of each part of a drive through the seven rooms, without any ROS."""
    world = read_simulated_place(ROOT / 'config' / 'seven_rooms.yaml')
    robot = Robot(world, rng=np.random.default_rng(1))
    drawn = world.plan.grid()
    grid = drawn
    planner = GridPlanner(grid)
    navigator = Navigator()
    navigator.set_map(grid)
    angles = robot.lidar.angles
    spent: dict[str, list[float]] = {'lidar': [], 'navigator': [], 'physics': []}

    def timed(part: str, work: Callable[[], Any]) -> Any:
        begun = time.process_time()
        result = work()
        spent[part].append((time.process_time() - begun) * 1e3)
        return result

    stops = size.of(('R1', 'R4', 'E', 'R3', 'R2', 'E'), ('R1', 'R4'), ('R1',))
    for stop in stops:
        goal = world.plan.place.positions[stop][:2]
        navigator.move(robot.base.odometry)
        navigator.task = Drive(planner.plan(robot.base.pose[:2], goal))
        while not navigator.task.state.ended:
            ranges = timed('lidar', robot.scan).astype(float)
            scan = Scan(angles, ranges, robot.lidar.range_max)
            navigator.move(robot.base.odometry)
            velocity = timed('navigator', lambda scan=scan: navigator.see(scan, robot.time))
            robot.base.command(velocity.speed, velocity.turn)
            timed('physics', lambda: robot.advance(0.1))
    rows = [
        (
            part,
            f'{statistics.median(times):.2f}',
            f'{np.percentile(times, 99):.2f}',
            f'{statistics.median(times) / 100:.1%}',
        )
        for part, times in spent.items()
    ]
    print_table(
        f'One step of a drive of {robot.base.travelled:.0f} m in {robot.time:.0f} s, '
        f'{robot.base.collisions} collisions; a step is due every 100 ms.',
        ('part', 'median CPU ms', '99 % CPU ms', 'of the step'),
        rows,
    )


@dataclass
class Drives:
    """What came of driving among people."""

    hours: float = 0.0
    drives: int = 0
    arrived: int = 0
    contacts: int = 0
    recoveries: int = 0
    metres: float = 0.0
    failed: Counter[str] = field(default_factory=Counter)
    steps_ms: list[float] = field(default_factory=list)


def among_people(model: PeopleModel, seconds: float, seed: int, place: str) -> Drives:
    """Drive from room to room among people, on the cores alone, for simulated seconds."""
    world = read_simulated_place(ROOT / 'config' / place)
    rng = np.random.default_rng(seed)
    people = People(world.plan, model, np.random.default_rng(seed + 1)) if model.count else None
    robot = Robot(world, rng=rng, people=people)
    driven, result = DrivenRobot(robot), Drives()
    driven.look()
    for room, drive in driven.rooms(rng, lambda: robot.time >= seconds):
        result.drives += 1
        if isinstance(drive, str):
            result.failed[drive] += 1
            continue
        result.recoveries += drive.recoveries
        if drive.state is DriveState.FAILED:
            result.failed[drive.reason.split('(')[0]] += 1
        assert driven.navigator.pose is not None
        in_room = world.place_at(*driven.navigator.pose[:2]) == room
        result.arrived += drive.state is DriveState.ARRIVED and in_room
    result.steps_ms = driven.steps_ms
    result.hours = robot.time / 3600
    result.contacts, result.metres = robot.base.collisions, robot.base.travelled
    return result


def people(size: Size) -> None:
    """Drives that arrive, and contacts by the robot's own motion, among people who walk."""
    seconds = size.of(4 * 3600.0, 300.0, 10.0)
    rows = []
    for place, manner, count in (
        ('office', 'polite', 0),
        ('office', 'polite', 5),
        ('office', 'pushy', 5),
        ('seven_rooms', 'pushy', 5),
    ):
        name = f'{place}, {count} {manner}'
        model = PeopleModel(count, manner=manner)
        lasting = seconds if count else seconds / 4
        did = among_people(model, lasting, seed=1, place=f'{place}.yaml')
        rows.append(
            (
                name,
                f'{did.hours:.2f}',
                f'{did.drives}',
                f'{did.arrived / max(did.drives, 1):.1%}',
                f'{did.contacts}',
                f'{did.recoveries}',
                f'{did.metres:.0f}',
                f'{np.median(did.steps_ms):.2f}',
                f'{np.percentile(did.steps_ms, 99):.2f}',
            )
        )
        for reason, count in did.failed.items():
            print(f'{name}: failed {count}: {reason}')
    print_table(
        'Drives among people at 1.2 m/s, simulated hours on the cores alone; a contact is one '
        "by the robot's own motion.",
        ('who', 'hours', 'drives', 'arrived', 'contacts', 'recoveries', 'm', 'step ms', '99 %'),
        rows,
    )


def kidnaps(size: Size) -> None:
    """Robots that are carried off while they drive: when they know where they are."""
    places = {
        'seven_rooms': (read_simulated_place(ROOT / 'config' / 'seven_rooms.yaml'), 16),
        'patrol_world': (read_simulated_place(ROOT / 'config' / 'patrol_world.yaml'), 10),
        'office, rooms alike': (read_simulated_place(ROOT / 'config' / 'office.yaml'), 10),
        'grid, all rooms alike': (SimulatedPlace.from_parameters(regular_places.grid(3, 3)), 10),
    }
    rows = []
    for name, (world, count) in places.items():
        count = size.of(count, 3, 1)
        ends = [kidnapped(world, seed, size.of(90.0, 90.0, 2.0)) for seed in range(count)]
        found = [after for after, _ in ends if after is not None]
        wrong = [longest for _, longest in ends]
        rows.append(
            (
                name,
                f'{count}',
                f'{len(found)}',
                f'{median(found):.1f}' if found else '-',
                f'{max(wrong):.1f}',
                f'{sum(longest > 60.0 for longest in wrong)}',
            )
        )
    print_table(
        'A driving robot is carried to another pose and watched for 90 s; wrong is an estimate '
        'more than 0.5 m off\nof a robot that does not say it is lost or unsure (covariance of '
        'amcl_pose).',
        ('place', 'kidnaps', 'found', 'after s, median', 'longest wrong s', 'wrong for 60 s'),
        rows,
    )


def kidnapped(world: SimulatedPlace, seed: int, watched: float) -> tuple[float | None, float]:
    """Carry a driving robot off; return when it knew its pose again, and how long it was wrong.

    Args:
        world: Where.
        seed: Of chance.
        watched: For how long it is watched, simulated seconds.
    """
    rng = np.random.default_rng(seed)
    robot = Robot(world, rng=np.random.default_rng(seed))
    begun = found = wrong_since = None
    longest = 0.0

    def stepped() -> None:
        nonlocal found, wrong_since, longest
        navigator = driven.navigator
        if begun is None:
            return
        assert navigator.pose is not None
        right = math.dist(navigator.pose[:2], robot.base.pose[:2]) <= 0.5
        if right and not navigator.lost and found is None:
            found = robot.time - begun
        if right or navigator.lost or navigator.ambiguous:
            wrong_since = None
        else:
            wrong_since = robot.time if wrong_since is None else wrong_since
            longest = max(longest, robot.time - wrong_since)

    driven = DrivenRobot(robot, stepped=stepped)
    free = driven.grid.centres_of(np.argwhere(driven.planner.cost > 0))

    def anywhere() -> geometry.Pose:
        x, y = free[int(rng.integers(len(free)))]
        return float(x), float(y), float(rng.uniform(-math.pi, math.pi))

    def is_over() -> bool:
        nonlocal begun
        if begun is None and robot.time >= 3.0:
            robot.base.pose = anywhere()
            robot.base.push(0.0, 0.0, 0.0)
            begun = robot.time
        since = 0.0 if begun is None else robot.time - begun
        return since >= watched or (found is not None and since >= found + 5.0)

    robot.base.pose = robot.base.odometry = anywhere()
    driven.navigator.believe(robot.base.pose)
    driven.look()
    for _ in driven.rooms(rng, is_over):
        pass
    return found, longest


def silence(size: Size) -> None:
    """Time and way until the robot stands when a sensor falls silent, in real time."""
    speeds = size.of((0.1, 0.2, 0.3, 0.4, 0.5, 0.58), (0.2, 0.58), (0.2,))
    rounds = size.of(5, 1, 1)
    rows = []
    with stack_in_real_time() as patrol:
        for topic in ('scan', 'odom'):
            rows += stops_after_silence(patrol, f'a mission, {topic}', speeds, rounds)
    with stack_in_real_time(('simulator', 'collision_monitor')) as patrol:
        commands = patrol.observer.create_publisher(Twist, 'cmd_vel', 1)
        began = time.monotonic()

        def command() -> None:
            # To and fro on the spot, with the acceleration of the base.
            forward = (time.monotonic() - began) % 4.0 < 2.0
            twist = Twist()
            twist.linear.x = 0.6 if forward else -0.6
            commands.publish(twist)

        patrol.observer.create_timer(0.05, command)
        rows += stops_after_silence(patrol, 'a foreign cmd_vel, scan', speeds, rounds)
    print_table(
        'A sensor of 10 Hz falls silent at a speed, real time, worst of '
        f'{rounds}; times from the first message that did not come.',
        ('who, what', 'm/s', 'until it brakes, s', 'until it stands, s', 'way, m'),
        rows,
    )


def standstill(size: Size) -> None:
    """Time and way from a person's Stop or Pause until the robot stands, simulated seconds."""
    from std_srvs.srv import SetBool, Trigger

    rounds = size.of(10, 2, 1)
    stop, release = ((SetBool, 'stop', SetBool.Request(data=on)) for on in (True, False))
    rows = []
    with stack_in_real_time() as patrol:
        rows.append(stands_after(patrol, 'a mission, Stop', rounds, stop, release))
        pause, resume = (
            (Trigger, f'robot_behavior/fsm/{name}', Trigger.Request())
            for name in ('pause', 'resume')
        )
        rows.append(stands_after(patrol, 'a mission, Pause', rounds, pause, resume))
    with stack_in_real_time(('simulator', 'collision_monitor')) as patrol:
        commands = patrol.observer.create_publisher(Twist, 'cmd_vel', 1)
        began = time.monotonic()

        def command() -> None:
            twist = Twist()
            twist.linear.x = 0.6 if (time.monotonic() - began) % 4.0 < 2.0 else -0.6
            commands.publish(twist)

        patrol.observer.create_timer(0.05, command)
        rows.append(stands_after(patrol, 'a foreign cmd_vel, Stop', rounds, stop, release))
    print_table(
        f'From the request until the robot stands, {rounds} times each, from 0.58 m/s or faster.',
        ('who, what', 'm/s', 'median, s', 'longest, s', 'longest way, m'),
        rows,
    )


def stands_after(
    patrol: Stack,
    who: str,
    rounds: int,
    held: tuple[Any, str, Any],
    freed: tuple[Any, str, Any],
) -> tuple[str, ...]:
    """Have the robot stand at full speed and go on; return a row.

    Args:
        patrol: The robot.
        who: What the row is called.
        rounds: How often.
        held: Type and name of the service that has it stand, and the request.
        freed: Those that let it go on.
    """
    base, seen = patrol.robot.base, []
    hold = patrol.observer.create_client(*held[:2])
    free = patrol.observer.create_client(*freed[:2])
    _await(hold.service_is_ready, 30.0)
    _await(free.service_is_ready, 30.0)
    for _ in range(rounds):
        _await(lambda: base.speed >= 0.58, 120.0, pause=0.002)
        begun, driven, top = patrol.robot.time, base.travelled, base.speed
        hold.call_async(held[2])
        _await(lambda: base.speed == 0.0, 30.0, pause=0.001)
        seen.append((top, patrol.robot.time - begun, base.travelled - driven))
        done = free.call_async(freed[2])
        _await(done.done, 30.0)
    speeds, times, ways = zip(*seen, strict=True)
    figures = max(speeds), statistics.median(times), max(times), max(ways)
    return who, *(f'{each:.2f}' for each in figures)


IN_REAL_TIME: dict[str, dict[str, Any]] = {
    '*': {'use_sim_time': False},
    'simulator': {'speed': 1.0},
}
"""Parameters of a stack on the machine's clock, as a mission runs by default."""


@contextmanager
def stack_in_real_time(nodes: Sequence[str] = ()) -> Iterator[Stack]:
    """Provide a stack on the machine's clock."""
    patrol = Stack(ROOT / 'config' / 'seven_rooms.yaml', IN_REAL_TIME, nodes)
    patrol.start()
    try:
        yield patrol
    finally:
        patrol.close()


def stops_after_silence(
    patrol: Stack, who: str, speeds: Sequence[float], rounds: int
) -> list[tuple[str, ...]]:
    """Silence a sensor at each speed; return rows with the longest times and way."""
    base = patrol.robot.base
    topic = '/odom' if who.endswith('odom') else '/scan'
    (publisher,) = (
        each for each in patrol.nodes['simulator'].publishers if each.topic_name == topic
    )
    speak = publisher.publish
    missed: list[tuple[float, float]] = []

    def be_silent(_message: Any) -> None:
        missed.append((patrol.robot.time, base.travelled))

    rows = []
    for wanted in speeds:
        stops = []
        for _ in range(rounds):
            _await(lambda: base.speed == 0.0, 60.0)
            _await(lambda wanted=wanted: base.speed >= wanted, 60.0, pause=0.002)
            missed.clear()
            publisher.publish = be_silent
            _await(lambda: missed, 5.0, pause=0.001)
            (begun, driven), top, braked = missed[0], base.speed, math.nan
            while base.speed != 0.0:
                time.sleep(0.001)
                top = max(top, base.speed)
                if math.isnan(braked) and base.speed < top - 0.02:
                    braked = patrol.robot.time - begun
                if patrol.robot.time - begun > 5.0:
                    raise SystemExit(f'{who}: the robot does not stop')
            stops.append((top, braked, patrol.robot.time - begun, base.travelled - driven))
            publisher.publish = speak
        rows.append((who, *(f'{max(each):.2f}' for each in zip(*stops, strict=True))))
    return rows


def stack(size: Size) -> None:
    """Return the simulated seconds per real second of the whole patrol."""
    seconds = size.of(30.0, 5.0, 0.5)
    rows = []
    for name, measure in (
        ('composed', lambda: composed(seconds)),
        ('a process per node', lambda: processes(seconds)),
    ):
        rate, cpu, distance = measure()
        rows.append((name, f'{rate:.1f}', f'{cpu:.1f}', f'{distance:.0f}'))
    print_table(
        f'The whole stack patrolling the seven rooms for {seconds:.0f} real seconds each.',
        ('how', 'simulated s / real s', 'simulated s / CPU s', 'metres driven'),
        rows,
    )


def composed(seconds: float) -> tuple[float, float, float]:
    """Return simulated seconds per real and per CPU second and metres driven, in one process."""
    patrol = Stack(ROOT / 'config' / 'seven_rooms.yaml')
    patrol.start()
    try:
        _await(lambda: patrol.robot.base.travelled > 1.0, 60.0)
        begun, used, simulated = time.monotonic(), time.process_time(), patrol.robot.time
        driven = patrol.robot.base.travelled
        time.sleep(seconds)
        passed = patrol.robot.time - simulated
        rate, cpu = passed / (time.monotonic() - begun), passed / (time.process_time() - used)
        return rate, cpu, patrol.robot.base.travelled - driven
    finally:
        patrol.close()


def processes(seconds: float) -> tuple[float, float, float]:
    """Return the same with a process for each node, started as the launcher does."""
    import rclpy
    from geometry_msgs.msg import PoseStamped

    from surveillance_runtime.conversions import seconds_of
    from surveillance_runtime.node import PatrolNode
    from surveillance_runtime.process import ExecutorThread
    from surveillance_runtime.qos import SENSOR_QOS
    from surveillance_runtime.testing import claim_domain

    domain = claim_domain()
    poses: list[tuple[float, float, float]] = []
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = PatrolNode('observer', context=context, use_global_arguments=False)

    def heard(message: PoseStamped) -> None:
        position = message.pose.position
        poses.append((seconds_of(message.header.stamp), position.x, position.y))

    node.create_subscription(PoseStamped, 'ground_truth', heard, SENSOR_QOS)
    spinner = ExecutorThread(context)
    spinner.executor.add_node(node)
    spinner.start()
    started: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryDirectory() as folder:
        arguments = ros_arguments(ROOT / 'config' / 'seven_rooms.yaml', Path(folder))
        arguments += ['--log-level', 'fatal']
        environ = node_environ(Run(domain=domain))
        try:
            for each in node_table.select('SIMULATED'):
                words = command([each], arguments, os.getpid())
                started.append(subprocess.Popen(words, env=environ))
            _await(lambda: poses and _driven(poses) > 1.0, 90.0)
            first, used, begun = len(poses), _cpu(started), time.monotonic()
            time.sleep(seconds)
            passed = poses[-1][0] - poses[first - 1][0]
            rate, cpu = passed / (time.monotonic() - begun), passed / (_cpu(started) - used)
            return rate, cpu, _driven(poses[first:])
        finally:
            end_processes(started, 15)
            node.stop()
            spinner.stop()
            node.destroy_node()
            rclpy.try_shutdown(context=context)


def _driven(poses: Sequence[tuple[float, float, float]]) -> float:
    return geometry.length(np.array([pose[1:] for pose in poses])) if len(poses) > 1 else 0.0


def _cpu(processes: Sequence[subprocess.Popen[bytes]]) -> float:
    """Return the CPU seconds that processes have used (Linux)."""
    return sum(cpu_seconds(process.pid) for process in processes)


def _await(condition: Callable[[], Any], patience: float, pause: float = 0.05) -> None:
    end = time.monotonic() + patience
    while not condition():
        if time.monotonic() > end:
            raise SystemExit('the robot does not drive: is everything set up?')
        time.sleep(pause)


@dataclass(frozen=True)
class Leg:
    """One drive of a mission, in simulated seconds; `stop` is until the next decision."""

    start: str
    goal: str
    begun: float
    seconds: float
    metres: float
    stop: float
    told: float


def mission(place: Path, seconds: float, *, real_time: bool = False) -> list[Leg]:
    """Patrol a place for simulated seconds; return the drives between which nothing else came."""
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / 'events.jsonl'
        given: dict[str, dict[str, Any]] = {'robot_behavior': {'record': str(record)}}
        patrol = Stack(place, given | (IN_REAL_TIME if real_time else {}))
        patrol.start()
        try:
            _await(lambda: patrol.robot.base.travelled > 0.1, 60.0)
            end = patrol.robot.time + seconds
            while patrol.robot.time < end:
                time.sleep(0.05)
        finally:
            patrol.close()
        return legs_of(record)


def legs_of(record: Path) -> list[Leg]:
    """Return the drives in a mission's record."""
    events = [json.loads(line) for line in record.read_text().splitlines()]
    events = [each for each in events if each['event'] != 'exploring']
    legs, at = [], ''
    for decision, visit, after in zip(events, events[1:], events[2:], strict=False):
        if decision['event'] in ('start', 'visit'):
            at = decision['place']
        kinds = [each['event'] for each in (decision, visit, after)]
        if kinds != ['decision', 'visit', 'decision'] or visit['place'] != decision['place']:
            continue
        told = re.search(r'longest wait on this round is ([0-9.]+) s', after['reason'])
        legs.append(
            Leg(
                at,
                visit['place'],
                decision['time'],
                visit['time'] - decision['time'],
                visit['distance'],
                after['time'] - visit['time'],
                float(told[1]) if told else math.nan,
            )
        )
    return legs


def pace(size: Size) -> None:
    """Measure the simulated seconds of the same legs and stops: at full speed beside real time."""
    place, seconds = ROOT / 'config' / 'seven_rooms.yaml', size.of(240.0, 35.0, 3.0)
    fast, real = mission(place, seconds), mission(place, seconds, real_time=True)
    if not _ways(fast) & _ways(real):
        print(f'\nThe two missions share no leg within {seconds:.0f} s.')
        return
    rows = []
    for what, measure in (
        ('leg', lambda leg: leg.seconds),
        ('stop', lambda leg: leg.stop),
        ('from decision to decision', lambda leg: leg.seconds + leg.stop),
    ):
        pairs = [
            tuple(
                median(measure(leg) for leg in legs if (leg.start, leg.goal) == way)
                for legs in (fast, real)
            )
            for way in sorted(_ways(fast) & _ways(real))
        ]
        ratios = [fast_one / real_one for fast_one, real_one in pairs]
        rows.append(
            (
                what,
                f'{len(pairs)}',
                f'{median(each for each, _ in pairs):.2f}',
                f'{median(each for _, each in pairs):.2f}',
                f'{median(ratios):.3f}',
                f'{min(ratios):.3f} to {max(ratios):.3f}',
            )
        )
    print_table(
        'The legs that two missions share, as fast as it goes and on the clock of the machine: '
        'seconds, medians.',
        ('what', 'legs', 'fast, s', 'real time, s', 'ratio', 'from to'),
        rows,
    )


def _ways(legs: Sequence[Leg]) -> set[tuple[str, str]]:
    return {(leg.start, leg.goal) for leg in legs}


def times(size: Size) -> None:
    """Time of legs and the longest wait: as the mission predicts them, beside what was driven."""
    seconds = size.of(700.0, 120.0, 60.0)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, place in places_to_patrol(Path(folder))[: size.of(None, 1, 1)]:
            positions = read_simulated_place(place).plan.place.positions
            learned = LegTimes()
            wrong, kept = [], 0
            legs = mission(place, seconds)
            for leg in legs:
                straight = math.dist(positions[leg.start][:2], positions[leg.goal][:2])
                expected = learned.expected(leg.start, leg.goal, straight)
                late = 1.0 + PERCENTILE_99 * learned.spread
                wrong.append(abs(expected / leg.seconds - 1.0))
                kept += leg.seconds <= late * expected
                learned.observe(leg.start, leg.goal, leg.seconds, straight, leg.metres)
            told, longest = longest_wait(legs)
            rows.append(
                (
                    name,
                    f'{len(legs)}',
                    f'{median(wrong):.1%}',
                    f'{np.percentile(wrong, 90):.1%}',
                    f'{kept / len(legs):.1%}',
                    f'{told:.0f}',
                    f'{longest:.0f}',
                    f'{longest / told:.2f}',
                )
            )
    print_table(
        f'{seconds:.0f} simulated seconds of patrol: how wrong the expected time of each leg is '
        'before it is driven,\nhow many keep to the time that 99 of 100 should keep to, and the '
        'longest wait from visit to visit in the second half.',
        ('place', 'legs', 'wrong by', '90 %', 'within p99', 'wait: told', 'driven', 'ratio'),
        rows,
    )


def places_to_patrol(folder: Path) -> list[tuple[str, Path]]:
    """Return eight places, those that are generated as files in a folder."""
    places = [(name, ROOT / 'config' / f'{name}.yaml') for name in ('seven_rooms', 'patrol_world')]
    for name, parameters in (
        ('grid 2x2', regular_places.grid(2, 2)),
        ('grid 3x2', regular_places.grid(3, 2)),
        ('ring of 6', regular_places.ring(6)),
        ('ring of 8', regular_places.ring(8)),
        ('tree 3x2', regular_places.tree(3, 2, random.Random(1))),
        ('tree 3x3', regular_places.tree(3, 3, random.Random(2))),
    ):
        file = folder / f'{name.replace(" ", "_")}.yaml'
        file.write_text(yaml.safe_dump({'/**': {'ros__parameters': parameters}}))
        places.append((name, file))
    return places


def longest_wait(legs: Sequence[Leg]) -> tuple[float, float]:
    """Return the longest wait that the mission tells when half is over, and the driven one."""
    half = (legs[0].begun + legs[-1].begun) / 2
    seen: dict[str, float] = {}
    waits = [0.0]
    for leg in legs:
        arrived = leg.begun + leg.seconds
        if leg.goal in seen and arrived > half:
            waits.append(arrived - seen[leg.goal])
        seen[leg.goal] = arrived + leg.stop
    bounds = [leg.told for leg in legs if leg.begun > half and not math.isnan(leg.told)]
    return (median(bounds) if bounds else math.nan), max(waits)


SECTIONS: dict[str, Callable[..., None]] = {
    'planning': planning,
    'control': control,
    'people': people,
    'kidnaps': kidnaps,
    'silence': silence,
    'stack': stack,
    'pace': pace,
    'times': times,
    'standstill': standstill,
}


def main() -> int:
    """Run the sections asked for."""
    parser = sized_parser(__doc__, quick='a run below 50 s')
    parser.add_argument('sections', nargs='*', choices=[*SECTIONS, []], help='default: all')
    options = parser.parse_args()
    logging.disable()
    for name in options.sections or SECTIONS:
        SECTIONS[name](options.size)
    return 0


if __name__ == '__main__':
    sys.exit(main())
