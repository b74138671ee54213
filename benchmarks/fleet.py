"""How long places go unvisited under a fleet's patrol, beside the published rules.

The pure simulation: no rules, no people, robots do not hinder each other. All begin in places drawn
by chance; every patrol runs for eight rounds of the map's shortest tour, the first three of which
are left out. Robots drive 0.6 m/s and spend 2 s in each place they enter.

- longest wait over tour / k: what one cyclic tour with all k robots comes to; on maps of up to 10
  places also over the optimum of all cyclic solutions, found by looking at each partition
- killed: one robot stops after four rounds; the longest wait from then on over tour / (k - 1).
  Beside it stands 2 (k - 1) / k: on one tour the places that the lost robot was about to visit were
  visited one gap before, and the next robot is one gap away
- charging: batteries that last four rounds and charge for half a round, a dock for four; the
  longest wait over the bound of `patrol_policy.fleet.charging_bound`, which knows the charging, and
  over what the same fleet could keep without batteries
- with rules (URGENT, CORRIDOR, ROOM; a corridor has three ways or more), a threshold of one round,
  no batteries: no place that is entered only when it is URGENT can wait less than the threshold, so
  the bound is the longer of that and the plan

========= =========================================================================================
shared    the library's `fleet.choose`
cyclic    all on one tour, begun at equal distances, none waits (Chevaleyre 2004)
partition a tour for each robot, the best cut of the tour (Chevaleyre 2004; one robot a part)
CR        the neighbour idle longest, known to all (Machado et al. 2002), ties by chance
SEBS      gain against others' intentions (Portugal and Rocha 2013); its gain limit, there given for
          each map and team, is here the best of three
========= =========================================================================================

    python benchmarks/fleet.py                    random maps; a minute or two
    python benchmarks/fleet.py --quick            fewer
    python benchmarks/fleet.py --graph FOLDER     maps of patrolling_sim
    python benchmarks/fleet.py --live --hours 1   the real programs in a simulated place with people
    python benchmarks/fleet.py --faults 1000      kills and cuts of a fleet of three in this process
    python benchmarks/fleet.py --hosts            real programs on hosts that fail; root only
    python benchmarks/fleet.py --armor 60         the ontology under ten robots, for 60 s
    python benchmarks/fleet.py --page 20          the page with 2, 8, 20 robots, 20 s each
    python benchmarks/fleet.py --composed 60      eight whole stacks, one process each, for 60 s
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.patrol import EXPLORATION_SECONDS, SPEED, random_graph
from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from patrol_policy.decision import DecisionSettings
from patrol_policy.fleet.assignment import FleetChoice, FleetRobot, FleetSettings, choose
from patrol_policy.fleet.charging_bound import PROVEN_UP_TO, charging_wait
from patrol_policy.fleet.partition import FleetPlan, exact_wait, fleet_plan
from patrol_policy.fleet.ruled import ruled
from patrol_policy.fleet.simulation import (
    FleetBattery,
    FleetPatrol,
    FleetPolicy,
    FleetView,
    Outage,
    shared,
)
from patrol_policy.graph import PatrolGraph
from patrol_policy.patrolling_sim import read_patrolling_sim
from patrol_policy.rule_table import Priorities

TEAMS = (2, 4, 8)
ROUNDS, LEFT_OUT, KILLED_AFTER = 8.0, 3.0, 4.0
RUN, CHARGE = 4.0, 0.5
PLACE = Path(__file__).resolve().parents[1] / 'config' / 'office.yaml'
RULED_UP_TO = 20
SEED = 1


def conscientious(seed: int) -> FleetPolicy:
    """Return CR."""
    draw = random.Random(seed)

    def choose_place(view: FleetView, name: str) -> FleetChoice:
        near = sorted(view.graph.leg_seconds[view.robots[name].place])
        place = min(near, key=lambda other: (view.visited_at[other], draw.random()))
        return FleetChoice(place, None, None, 'idle longest')

    return choose_place


def bayesian(seed: int, gain_limit: float) -> FleetPolicy:
    """Return SEBS; the gain is idleness over the time of the way."""
    draw, intends = random.Random(seed), dict[str, str]()

    def choose_place(view: FleetView, name: str) -> FleetChoice:
        here = view.robots[name].place
        team = len(view.robots)

        def worth(place: str) -> tuple[float, float]:
            gain = (view.now - view.visited_at[place]) / view.graph.leg_seconds[here][place]
            value = 0.1 * math.exp(math.log(10.0) * min(1.0, gain / gain_limit))
            others = sum(goal == place for robot, goal in intends.items() if robot != name)
            if others:
                value *= 2.0 ** (team - others) / (2.0**team - 1.0)
            return value, draw.random()

        intends[name] = max(sorted(view.graph.leg_seconds[here]), key=worth)
        return FleetChoice(intends[name], None, None, 'best gain')

    return choose_place


def along(plan: FleetPlan) -> FleetPolicy:
    """Return a policy that follows the tours of a plan, each robot from its place in it."""
    ways = [group.stops for group in plan.groups for _ in range(group.robots)]
    begins = [
        int((group.offsets <= number * group.wait + 1e-9).sum() - 1)
        for group in plan.groups
        for number in range(group.robots)
    ]
    at: dict[str, tuple[int, int]] = {}

    def choose_place(view: FleetView, name: str) -> FleetChoice:
        if name in at:
            way, number = at[name]
            at[name] = way, (number + 1) % len(ways[way])
        else:
            way = len(at) % len(ways)
            at[name] = way, begins[way]
        way, number = at[name]
        return FleetChoice(ways[way][number], None, None, 'next on the tour')

    return choose_place


def policies(graph: PatrolGraph, team: int) -> dict[str, Sequence[Callable[[], FleetPolicy]]]:
    """Return what is compared; where there are several of a name, the best counts."""
    return {
        'shared': [lambda: shared],
        'cyclic': [lambda: along(fleet_plan(graph, team, whole=True))],
        'partition': [lambda: along(fleet_plan(graph, team, alone=True))],
        'CR': [lambda: conscientious(SEED)],
        'SEBS': [partial(bayesian, SEED, limit) for limit in (10.0, 30.0, 100.0)],
    }


def starts(graph: PatrolGraph, team: int) -> dict[str, str]:
    """Return places drawn by chance."""
    draw = random.Random(SEED)
    return {f'robot{number + 1}': draw.choice(graph.places) for number in range(team)}


def compare(maps: Iterable[tuple[str, PatrolGraph]]) -> None:
    """Print the longest waits of all policies, without and with a robot killed."""
    names = ['shared', 'cyclic', 'partition', 'CR', 'SEBS']
    steady = [['longest / (tour / k)', 'places', 'k', 'plan', 'optimum', *names]]
    killed = [['killed: / (tour / (k-1))', 'k', '2(k-1)/k', *names]]
    charged = [['charging / (tour / k)', 'k', 'plan', 'bound', 'longest', 'longest / bound']]
    charged[0] += ['without', 'stranded', 'charges', 'docks']
    with_rules = [['with rules', 'k', 'longest / bound', 'robots stood still']]
    ratios: list[float] = []
    proven: list[float] = []
    behind: list[str] = []
    for name, graph in maps:
        tour = graph.tour.length
        for team in TEAMS:
            even = tour / team
            one_less = tour / (team - 1)
            waits, kills = {}, {}
            for policy, variants in policies(graph, team).items():
                runs = []
                for make in variants:
                    run = FleetPatrol(graph, starts(graph, team), make())
                    run.until(ROUNDS * tour)
                    lost = Outage('robot2', KILLED_AFTER * tour)
                    cut = FleetPatrol(graph, starts(graph, team), make(), outages=(lost,))
                    cut.until(ROUNDS * tour)
                    runs.append((run.longest(LEFT_OUT * tour), cut.longest(KILLED_AFTER * tour)))
                waits[policy] = min(wait for wait, _ in runs) / even
                kills[policy] = min(wait for _, wait in runs) / one_less
            plan = fleet_plan(graph, team).wait / even
            optimum = ''
            if len(graph.places) <= PROVEN_UP_TO:
                least = exact_wait(graph, team)
                # With as many robots as places each stands in one, and nothing waits.
                if least > 0.0:
                    proven.append(waits['shared'] * even / least)
                    optimum = f'{least / even:.3f}'
            ratios.append(waits['shared'])
            if waits['shared'] > 1.001 * min(waits.values()):
                best = min(waits, key=lambda key: waits[key])
                behind.append(f'{name}, k = {team}: {best}')
            cells = [f'{waits[policy]:.3f}' for policy in names]
            steady.append([name, f'{len(graph.places)}', f'{team}', f'{plan:.3f}', optimum, *cells])
            killed.append(
                [name, f'{team}', f'{2 * (team - 1) / team:.2f}']
                + [f'{kills[policy]:.3f}' for policy in names]
            )
            charged.append([name, f'{team}', *charging(graph, team)])
            if len(graph.places) <= RULED_UP_TO and team < len(graph.places):
                with_rules.append([name, f'{team}', *within_rules(graph, team)])
    for rows in (steady, killed, charged, with_rules):
        print(table(rows), end='\n\n', flush=True)
    print(f'shared over tour / k: worst {max(ratios):.3f} of {len(ratios)}')
    if proven:
        print(
            f'shared over the optimum of cyclic solutions: worst {max(proven):.3f} of {len(proven)}'
        )
    print(f'another one ahead of shared: {"; ".join(behind) or "nowhere"}')


def charging(graph: PatrolGraph, team: int) -> list[str]:
    """Return the row of a patrol whose robots charge."""
    tour = graph.tour.length
    docks = graph.places[: max(1, team // 4)]
    run = FleetPatrol(
        graph,
        starts(graph, team),
        settings=FleetSettings(docks=docks),
        battery=FleetBattery(RUN * tour, CHARGE * tour),
    )
    run.until(3.0 * ROUNDS * tour)
    wait, even = run.longest(LEFT_OUT * tour), tour / team
    bound = charging_wait(graph, team, docks, RUN * tour, CHARGE * tour)
    planned = fleet_plan(graph, team, docks=docks).wait * (1.0 + CHARGE / RUN)
    return [
        f'{planned / even:.3f}',
        f'{bound / even:.3f}',
        f'{wait / even:.3f}',
        f'{wait / bound:.3f}',
        f'{fleet_plan(graph, team).wait / even:.3f}',
        *(f'{run.strandings}', f'{len(run.charges)}', f'{len(docks)}'),
    ]


def within_rules(graph: PatrolGraph, team: int) -> list[str]:
    """Return the row of a patrol whose robots keep the rules."""
    tour = graph.tour.length
    classes = {
        place: frozenset({'ROOM', 'CORRIDOR'} if len(ways) > 2 else {'ROOM'})
        for place, ways in graph.leg_seconds.items()
    }
    settings = DecisionSettings(priorities=Priorities())
    policy = ruled(classes, dict.fromkeys(graph.places, tour), settings)
    run = FleetPatrol(graph, starts(graph, team), policy)
    run.until(ROUNDS * tour)
    stood = sum(choice.until is not None for _, _, choice in run.decisions)
    wait, bound = run.longest(LEFT_OUT * tour), max(tour, fleet_plan(graph, team).wait)
    return [f'{wait / bound:.3f}', f'{stood / len(run.decisions):.0%} of decisions']


def scale(places: int, team: int) -> None:
    """Print how long a choice takes."""
    graph = random_graph(places, SEED).graph
    began = time.thread_time()
    graph.tour, graph.distances  # noqa: B018 - found once for a map
    once = time.thread_time() - began
    plans = []
    for robots in (team, team - 1):
        began = time.thread_time()
        fleet_plan(graph, robots)
        plans.append(time.thread_time() - began)
    run = FleetPatrol(graph, starts(graph, team))
    run.until(graph.tour.length / 10.0)
    seconds = []
    facts = list(run.robots.values())
    for _ in range(3):
        for robot in facts:
            began = time.thread_time()
            choose(graph, facts, robot.name, run.now, None, run.visited_at)
            seconds.append(time.thread_time() - began)
    seconds.sort()
    lost = [_silent(robot) if robot.name == 'robot2' else robot for robot in facts]
    began = time.thread_time()
    choose(graph, lost, 'robot1', run.now, None, run.visited_at)
    change = time.thread_time() - began
    print(
        f'\n{places} places, {team} robots, time of the processor: map once {once:.2f} s, '
        f'a plan for a new number {1000 * max(plans):.0f} ms, a choice '
        f'{1000 * seconds[len(seconds) // 2]:.1f} ms (99 %: '
        f'{1000 * seconds[int(0.99 * len(seconds))]:.1f} ms), the first after one is lost '
        f'{1000 * change:.1f} ms'
    )


def fail(count: int) -> None:
    """Print what so many kills and cuts in a fleet of three cost, judged by the truth."""
    root = str(Path(__file__).resolve().parents[1])
    if root not in sys.path:
        sys.path.insert(0, root)
    from tests.behaviour.fleet_faults import Fleet

    with tempfile.TemporaryDirectory(prefix='fleet-') as folder:
        fleet = Fleet(3, Path(folder))
        fleet.run(300.0)
        for number in range(count):
            fleet.fail()
            fleet.settle()
            if number % 10 == 9:
                fleet.run(60.0)
                fleet.look_for_doubles()
                fleet.forget(600.0)
        visits = sum(robot.entered for robot in fleet.robots.values())
    rows = [['fault', 'made'], *([kind, f'{made}'] for kind, made in sorted(fleet.faults.items()))]
    print(table(rows))
    print(
        f'{count} faults in {fleet.now / 3600.0:.1f} simulated hours, {visits} visits: '
        f'{len(fleet.lost)} lost, {len(fleet.invented)} invented, {len(fleet.twice)} twice URGENT, '
        f'{len(fleet.behind)} left behind'
    )
    for each in (*fleet.lost, *fleet.invented, *fleet.twice, *fleet.behind)[:20]:
        print(f'  {each}')


def _silent(robot: FleetRobot) -> FleetRobot:
    return replace(robot, heard_at=-1e6)


def main() -> None:
    """Run as a command."""
    parser = sized_parser(__doc__, quick='fewer maps')
    parser.add_argument('--graph', type=Path, help='a folder of patrolling_sim maps')
    parser.add_argument('--faults', type=int, metavar='N', help='kills and cuts')
    parser.add_argument('--armor', type=float, metavar='SECONDS', help='calls of ten robots')
    parser.add_argument('--composed', type=float, metavar='SECONDS', help='eight whole stacks')
    parser.add_argument('--page', type=float, metavar='SECONDS', help='what the page takes')
    parser.add_argument('--hosts', action='store_true', help='real programs on hosts that fail')
    parser.add_argument('--keep', type=Path, help='folder for what --hosts writes')
    parser.add_argument('--live', action='store_true', help='the real programs in a simulation')
    parser.add_argument('--hours', type=float, default=1.0, help='simulated, of --live')
    parser.add_argument('--robots', type=int, help='of --live (4), --hosts (2), --composed (8)')
    parser.add_argument('--people', type=int, default=2, help='who walk about, of --live')
    parser.add_argument('--map', type=Path, action='append', help='a place, of --live')
    words = parser.parse_args()
    if words.faults is not None:
        fail(words.faults)
        return
    if words.page is not None:
        from benchmarks.fleet_page import page_under

        page_under((2, 8, 20), words.page, PLACE)
        return
    if words.hosts:
        from benchmarks.fleet_hosts import fail_hosts

        raise SystemExit(
            fail_hosts(words.robots or 2, quick=words.size is not Size.FULL, keep=words.keep)
        )
    if words.armor is not None or words.composed is not None:
        from benchmarks.fleet_load import CONFIG, armor_under, composed

        place = words.map[0] if words.map else CONFIG / 'office.yaml'
        if words.armor is not None:
            armor_under(10, words.armor, place)
        if words.composed is not None:
            composed(words.robots or 8, words.composed, place)
        return
    if words.live:
        from benchmarks.fleet_live import CONFIG, compare_places

        places = words.map or [CONFIG / 'seven_rooms.yaml', CONFIG / 'office.yaml']
        compare_places(places, words.robots or 4, 3600.0 * words.hours, words.people)
        return
    if words.graph is not None:
        files = sorted(words.graph.glob('**/*.graph'))
        if not files:
            parser.error(f'{words.graph}: no file *.graph')
        maps = [
            (file.stem, read_patrolling_sim(file, SPEED, EXPLORATION_SECONDS)) for file in files
        ]
    else:
        sizes = words.size.of((8, 9, 10, 12, 20, 35, 60, 100), (8, 10, 20), (8,))
        maps = [(f'random {size}', random_graph(size, SEED).graph) for size in sizes]
    compare(maps)
    scale(*words.size.of((1000, 100), (1000, 100), (30, 4)))
    if words.size is Size.SMOKE:
        fail(1)


if __name__ == '__main__':
    main()
