"""How long places go unvisited under each policy, beside the bound that no robot can beat.

Every policy patrols every map for 24 simulated hours with fixed seeds. The robot drives 0.6 m/s and
spends 2 s in each place it enters; all places count as just visited at the start.

- longest: the longest time any place went unvisited, from visit to visit
- ratio:   longest / bound, where the bound is the shortest closed tour: exact up to 12 places and
           wherever blocks of the map are that small or the lower bound meets the tour, else the
           Held-Karp lower bound (marked >=)
- mean:    the time a place went unvisited, averaged over places and time
- late:    longest - threshold
- times are those of the processor

    python benchmarks/patrol.py                       all maps; takes long
    python benchmarks/patrol.py --quick               small maps, below a minute
    python benchmarks/patrol.py --graph FOLDER ...    maps of patrolling_sim
    python benchmarks/patrol.py --random 100 --table rules    100 random maps within the rules
    python benchmarks/patrol.py --plot docs/images/patrol.png
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.literature_policies import LITERATURE
from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from floor_plans import read_place
from patrol_policy.decision import QUIET, RECHARGE
from patrol_policy.graph import (
    GraphError,
    PatrolGraph,
    graph_of_places,
)
from patrol_policy.hours import Calendar, WeeklyHours
from patrol_policy.idleness_bounds import LATER, NEVER, WITHIN, idleness_bounds
from patrol_policy.lower_bounds import charge_bound, default_table, rule_bound
from patrol_policy.patrolling_sim import read_patrolling_sim
from patrol_policy.policies import DEFAULT_POLICY, POLICIES
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import (
    Patrol,
    PatrolRun,
    SimulatedBattery,
)

DAY = 86400.0
SPEED, EXPLORATION_SECONDS = 0.6, 2.0
SEED = 1
URGENCY = 7.0
"""Threshold of the seeds' ontology, seconds."""
LARGE = 60
"""Rules and batteries are compared on maps of up to so many places."""
RULED = ('tour', 'lookahead', 'oldest', 'seed')
"""Policies run within the seeds' rules; the literature's run without any."""
SIZES = (5, 8, 12, 20, 35, 60, 100, 150)
"""Places of the random maps, in turn."""
TABLES = ('compare', 'battery', 'rules', 'choice', 'configured', 'hours')
FREE = tuple(LITERATURE)
POLICIES.update(LITERATURE)


@dataclass(frozen=True)
class Map:
    """A map with its name and where the robot starts."""

    name: str
    graph: PatrolGraph
    start: str


def place_map(name: str, path: Path) -> Map:
    """Return a place of config/."""
    place = read_place(path).place
    neighbours = {
        room: list(dict.fromkeys(o for door in doors for o in place.doors[door] if o != room))
        for room, doors in place.rooms.items()
    }
    return Map(
        name, graph_of_places(neighbours, place.positions, SPEED, EXPLORATION_SECONDS), place.start
    )


def grid(width: int, height: int) -> Map:
    """Return a grid of places 5 m apart."""
    positions = {f'P{x}_{y}': (5.0 * x, 5.0 * y) for x in range(width) for y in range(height)}
    neighbours = {
        f'P{x}_{y}': [
            name
            for name in (f'P{x + 1}_{y}', f'P{x - 1}_{y}', f'P{x}_{y + 1}', f'P{x}_{y - 1}')
            if name in positions
        ]
        for x in range(width)
        for y in range(height)
    }
    graph = graph_of_places(neighbours, positions, SPEED, EXPLORATION_SECONDS)
    return Map(f'grid {width}x{height}', graph, 'P0_0')


def _joined(pairs: Sequence[tuple[int, int]], draw: random.Random) -> PatrolGraph:
    legs: dict[str, dict[str, float]] = {}
    for first, second in pairs:
        metres = draw.uniform(2.0, 10.0)
        legs.setdefault(f'P{first}', {})[f'P{second}'] = metres / SPEED
        legs.setdefault(f'P{second}', {})[f'P{first}'] = metres / SPEED
    return PatrolGraph(legs, EXPLORATION_SECONDS)


def tree(count: int) -> Map:
    """Return a random tree of places 2 to 10 m apart."""
    draw = random.Random(SEED)
    pairs = [(child, draw.randrange(max(0, child - 10), child)) for child in range(1, count)]
    return Map(f'tree {count}', _joined(pairs, draw), 'P0')


def ring(count: int) -> Map:
    """Return a ring of places 2 to 10 m apart."""
    draw = random.Random(SEED)
    pairs = [(number, (number + 1) % count) for number in range(count)]
    return Map(f'ring {count}', _joined(pairs, draw), 'P0')


def maps(size: Size) -> Iterator[Map]:
    """Yield the maps of the benchmark."""
    yield place_map('seven rooms', ROOT / 'config' / 'seven_rooms.yaml')
    if size is Size.SMOKE:
        return
    yield place_map('patrol world', ROOT / 'config' / 'patrol_world.yaml')
    yield place_map('office, 40 rooms', ROOT / 'config' / 'office.yaml')
    yield grid(5, 5)
    if size is Size.FULL:
        yield grid(10, 10)
        yield tree(100)
        yield ring(100)
        yield grid(32, 31)
        yield tree(1000)
        yield ring(1000)


def patrol(
    place: Map,
    policy: str,
    hours: float,
    threshold: float = URGENCY,
    battery: SimulatedBattery | None = None,
) -> PatrolRun:
    """Return one patrol."""
    priorities = Priorities() if policy in RULED else Priorities(())
    run = Patrol(
        place.graph,
        priorities,
        policy,
        threshold,
        place.start,
        battery,
        generator=random.Random(SEED),
    )
    for _ in run.until(hours * 3600.0):
        pass
    return run.run


def compare(place: Map, hours: float) -> dict[str, PatrolRun]:
    """Return all policies on one map, printed."""
    began = time.thread_time()
    tour = place.graph.tour
    planning = time.thread_time() - began
    sign = '' if tour.exact else '>= '
    print(
        f'\n{place.name}: {len(place.graph.places)} places, bound {sign}{tour.bound:.1f} s, '
        f'tour {tour.length:.1f} s (found in {planning:.2f} s), {hours:g} h'
    )
    rows = [['policy', 'rules', 'longest s', 'ratio', 'mean s', 'late s', 'moves', 'ms/choice']]
    runs = {}
    for policy in (*RULED, *FREE):
        began = time.thread_time()
        run = runs[policy] = patrol(place, policy, hours)
        spent = time.thread_time() - began
        rows.append(
            [
                policy + (' (default)' if policy == DEFAULT_POLICY else ''),
                'yes' if policy in RULED else 'no',
                f'{run.longest:.1f}',
                f'{run.longest / tour.bound:.3f}',
                f'{run.mean:.1f}',
                f'{max(0.0, run.longest - URGENCY):.1f}',
                f'{run.moves}',
                f'{1000.0 * spent / run.moves:.2f}',
            ]
        )
    print(table(rows), flush=True)
    return runs


def random_graph(count: int, seed: int, uneven: bool = False) -> Map:
    """Return a random planar map: a spanning tree of a triangulation and a quarter of its rest.

    Args:
        count: Places.
        seed: Of chance.
        uneven: Whether the way back takes another time, up to half as long again.
    """
    import networkx
    import numpy as np
    from scipy.spatial import Delaunay

    draw = np.random.default_rng(seed)
    points = draw.uniform(0.0, 10.0 * math.sqrt(count), (count, 2))
    corners = Delaunay(points).simplices
    pairs = sorted(
        {tuple(sorted((int(a), int(b)))) for t in corners for a in t for b in t if a < b}
    )
    lengths = {pair: math.dist(points[pair[0]], points[pair[1]]) for pair in pairs}
    whole = networkx.Graph()
    whole.add_weighted_edges_from((*pair, lengths[pair] * draw.uniform(0.7, 1.3)) for pair in pairs)
    kept = {tuple(sorted(edge)) for edge in networkx.minimum_spanning_tree(whole).edges}
    kept |= {pair for pair in pairs if draw.random() < 0.25}
    legs: dict[str, dict[str, float]] = {f'P{number:03}': {} for number in range(count)}
    for first, second in sorted(kept):
        for start, goal in ((first, second), (second, first)):
            slower = draw.uniform(1.0, 1.5) if uneven else 1.0
            legs[f'P{start:03}'][f'P{goal:03}'] = slower * lengths[first, second] / SPEED
    name = f'random {count}, seed {seed}' + (', uneven' if uneven else '')
    return Map(name, PatrolGraph(legs, EXPLORATION_SECONDS), 'P000')


def within_rules(
    places: Sequence[Map], factors: Sequence[float], periods: float, states: int
) -> None:
    """Compare the ruled policies with a bound that knows the rules, by threshold / tour.

    The bound is `rule_bound`: marked ``*`` where a walk is known that comes within two percent of
    it. Elsewhere no robot need be able to reach it, and a ratio above 1 is not proven to be the
    policy's fault.
    """
    names = RULED[:3]
    print(
        '\nlongest time from visit to visit over the bound that knows the rules (* can be reached)'
    )
    print(f'{"map":32} threshold / tour  {"  ".join(f"{name:>9}" for name in names)}')
    ratios: dict[float, list[float]] = {factor: [] for factor in factors}
    worse = []
    for place, factor in itertools.product(places, factors):
        graph, length = place.graph, place.graph.tour.length
        threshold = factor * length
        bound = rule_bound(graph, default_table(graph, threshold), states=states)
        hours = periods * max(length, threshold) / 3600.0
        found = {name: patrol(place, name, hours, threshold).settled / bound.low for name in names}
        reached = bound.within(0.02) or min(found.values()) <= 1.02
        ratios[factor].append(found['tour'])
        if found['tour'] > 1.002 * min(found.values()):
            worse.append(f'{place.name} at {factor:g}')
        cells = (f'{ratio:.3f}{"*" if reached else " "}' for ratio in found.values())
        line = '  '.join(f'{cell:>9}' for cell in cells)
        print(f'{place.name:32} {factor:16g}  {line}', flush=True)
    for factor, values in ratios.items():
        values.sort()
        print(
            f'tour at {factor:g}: median {values[len(values) // 2]:.3f}, '
            f'90 % {values[int(0.9 * len(values))]:.3f}, worst {values[-1]:.3f}; '
            f'within 1.05: {sum(value <= 1.05 for value in values)} of {len(values)}'
        )
    print(f'tour worse than oldest or lookahead: {", ".join(worse) or "nowhere"}', flush=True)


def first_choice(count: int) -> None:
    """How long the first choice on a large map takes, and the next ones."""
    place = random_graph(count, SEED)
    run = Patrol(place.graph, Priorities(), DEFAULT_POLICY, URGENCY, place.start)
    seconds = []
    for _ in range(401):
        began = time.thread_time()
        run.step()
        seconds.append(time.thread_time() - began)
    first, following = seconds[0], sorted(seconds[1:])
    mean, late = sum(following) / len(following), following[int(0.99 * len(following))]
    print(
        f'\n{count} places, time of the processor: first choice {first:.2f} s, '
        f'next {1000.0 * mean:.2f} ms (99 %: {1000.0 * late:.2f} ms)'
    )


def configured(places: Sequence[Map], hours: float) -> None:
    """Print what the threshold of config/parameters.yaml comes to, with the default policy."""
    text = (ROOT / 'config' / 'parameters.yaml').read_text(encoding='utf-8')
    nodes = yaml.safe_load(text)
    threshold = nodes['/**']['ros__parameters']['urgency_threshold']
    print(f'\nurgency_threshold {threshold} s, {DEFAULT_POLICY}, {hours:g} h, once settled')
    rows = [['place', 'tour s', 'longest s', 'late s', 'mean s', 'moves that are URGENT']]
    for place in places:
        run, tour = patrol(place, DEFAULT_POLICY, hours, threshold), place.graph.tour.length
        urgent = run.rules.get('URGENT', 0) / run.moves
        late = run.settled - max(threshold, tour)
        rows.append(
            [
                place.name,
                f'{tour:.1f}',
                f'{run.settled:.1f}',
                f'{late:.1f}',
                f'{run.mean:.1f}',
                f'{100.0 * urgent:.0f} %',
            ]
        )
    print(table(rows), flush=True)


def strandings(place: Map, hours: float) -> None:
    """Measure the battery: fixed level against a reserve for the worst leg and the way home."""
    graph = place.graph
    far = max(graph.seconds(place.start, other) for other in graph.places)
    print(f'\n{place.name}: battery, farthest place {far:.0f} s from the station, {hours:g} h')
    rows = [['range of a full battery', 'level', 'strandings', 'recharges', 'longest s']]
    for factor in (3.0, 4.0, 6.0, 10.0):
        draw = 100.0 / (factor * far)
        for keeps in (False, True):
            run = patrol(
                place,
                DEFAULT_POLICY,
                hours,
                battery=SimulatedBattery(draw=draw, keeps_reserve=keeps),
            )
            rows.append(
                [
                    f'{factor:g} times as far ({factor * far:.0f} s)',
                    'reserve' if keeps else 'fixed 20 %',
                    f'{run.strandings}',
                    f'{run.recharges}',
                    f'{run.longest:.0f}',
                ]
            )
    print(table(rows), flush=True)


def with_battery(count: int, states: int) -> None:
    """Compare with the bound that knows rules and charge, on random maps and batteries.

    Maps of 5 to 12 places, ranges of 1.2 to 20 tours, stops of 2 to 300 s, charges of 0 to 2 tours.
    The idleness bound told before is compared with what came.
    """
    ratios, starved, broken, kept_after_all, never = [], 0, 0, 0, 0
    proven = 0
    print(f'\n{"map":22} range  stop charge  threshold   bound       wait  ratio (tours, s)')
    for number in range(count):
        draw = random.Random(number)
        place = random_graph(5 + number % 8, number, number % 4 == 3)
        stop = draw.uniform(2.0, 300.0)
        graph = PatrolGraph(place.graph.leg_seconds, stop)
        tour = graph.tour.length
        reach, charge = draw.uniform(1.2, 20.0), draw.uniform(0.01, 2.0)
        factor = draw.choice((0.1, 0.5, 1.0, 2.0))
        battery = SimulatedBattery(100.0 / (reach * tour), 100.0 / (charge * tour))
        run = Patrol(graph, Priorities(), DEFAULT_POLICY, factor * tour, place.start, battery)
        run.level = battery.limits.stop_recharge
        told = {
            each.place: each
            for each in idleness_bounds(run.world(), run.known_battery(), run.settings)
        }
        period = (1.0 + charge) * max(1.0, factor) * tour
        for _ in run.until(6.0 * period):
            pass
        run.run.settled, run.run.waits = 0.0, {}
        begun = dict(run.visited_at)
        for _ in run.until(run.now + 12.0 * period):
            pass
        wait = max(run.run.waits[name] for name, each in told.items() if each.verdict != NEVER)
        for name, each in told.items():
            visited = run.visited_at[name] > begun[name]
            if each.verdict == NEVER:
                never += 1
                kept_after_all += visited
                continue
            starved += not visited
            broken += run.run.waits[name] > each.wait + 0.1
            if each.verdict == LATER:
                kept_after_all += run.run.waits[name] <= each.threshold
            elif each.verdict == WITHIN:
                broken += run.run.waits[name] > each.threshold + 0.1
        if any(each.verdict == NEVER for each in told.values()):
            print(f'{place.name:22} {reach:5.1f} {stop:5.0f} {charge:6.2f}  not all in range')
            continue
        bound = charge_bound(run.planner.rule_graph, states=states)
        proven += bound.within(0.02)
        ratios.append(wait / bound.low)
        sign = '*' if bound.within(0.02) else ' '
        print(
            f'{place.name:22} {reach:5.1f} {stop:5.0f} {charge:6.2f} {factor:10g} '
            f'{bound.low:7.0f}{sign} {wait:10.0f} {ratios[-1]:6.3f}',
            flush=True,
        )
    ratios.sort()
    print(
        f'{len(ratios)} maps: median {ratios[len(ratios) // 2]:.3f}, worst {ratios[-1]:.3f}; '
        f'bound exact on {proven} (*), a lower bound on the others\n'
        f'places never visited though they can be: {starved}; bound told and not kept: {broken}; '
        f'no bound told, and kept: {kept_after_all}; rightly told to be out of range: {never}'
    )


WALL_CLOCK = ZoneInfo('Europe/Rome')
FORBIDDEN = {
    'R1': lambda when: not 9 <= when.hour < 12,
    'R2': lambda when: True,
    'R3': lambda when: when.weekday() > 4 or not 8 <= when.hour < 18,
    'R4': lambda when: (when.hour, when.minute) >= (8, 20) or when.hour < 8,
}
"""When the places of `month` must not be entered, written down once more from the hours alone."""


def month(days: int) -> None:
    """Patrol over a month with hours, thresholds, a keep-out, quiet hours; count what they forbid.

    The clock on the wall is set forward within it.
    """
    hours = {
        'R1': 'may daily 09:00-12:00; not daily 00:00-09:00, 12:00-24:00',
        'R3': 'mon-fri 08:00-18:00',
        'R4': 'daily 08:00-08:20',
    }
    calendar = Calendar(
        {place: WeeklyHours.parse(text) for place, text in hours.items()},
        quiet=WeeklyHours.parse('daily 22:00-06:00'),
        keep_out=frozenset({'R2'}),
        zone=WALL_CLOCK,
    )
    begin = datetime(2024, 3, 15, 7, 0, tzinfo=WALL_CLOCK).timestamp()
    place = place_map('seven rooms', ROOT / 'config' / 'seven_rooms.yaml')
    graph = PatrolGraph(place.graph.leg_seconds, 100.0)
    tour = graph.tour.length
    run = Patrol(
        graph,
        Priorities(),
        DEFAULT_POLICY,
        0.9 * tour,
        place.start,
        SimulatedBattery(100.0 / (5.0 * tour), 100.0 / tour),
        own_thresholds={'C1': 0.5 * tour, 'R3': 3600.0},
        calendar=calendar,
        began=begin,
    )
    visits = violations = late = 0
    opened = set()
    for decision in run.until(begin + days * DAY):
        when = datetime.fromtimestamp(run.now, WALL_CLOCK)
        if decision.rule == QUIET:
            continue
        visits += 1
        violations += run.place in FORBIDDEN and FORBIDDEN[run.place](when)
        # What was begun before the quiet hours is ended; nothing is begun in them.
        left = datetime.fromtimestamp(decision.time, WALL_CLOCK)
        late += decision.rule != RECHARGE and not 6 <= left.hour < 22
        if run.place == 'R4':
            opened.add(when.date())
    print(
        f'\n{days} days, tour {tour:.0f} s: {visits} visits, {violations} where it is closed or '
        f'kept out, {late} begun in quiet hours; a place that is open for 20 minutes a day was '
        f'visited on {len(opened)} days; {run.run.strandings} strandings'
    )


COLOURS = {
    'tour': (40, 120, 30),
    'lookahead': (200, 140, 30),
    'oldest': (180, 90, 150),
    'seed': (60, 60, 220),
    'random': (150, 150, 230),
    'CR': (210, 170, 210),
    'HCR': (200, 200, 120),
    'HPCC': (120, 200, 200),
    'cycle': (120, 120, 120),
}
LEAST_WIDTH = 860
"""Pixels that the legend of a picture needs."""


def plot(path: Path, hours: float, results: dict[str, tuple[float, dict[str, PatrolRun]]]) -> None:
    """Draw the ratios to the bound on a logarithmic scale, a group of bars for each map."""
    import cv2
    import numpy as np

    left, top, height, bar, gap = 70, 50, 320, 12, 26
    group = bar * len(COLOURS) + gap
    width = max(left + group * len(results) + 20, LEAST_WIDTH)
    image = np.full((top + height + 90, width, 3), 255, np.uint8)
    greatest = max(run.longest / bound for bound, runs in results.values() for run in runs.values())
    decades = math.log10(max(greatest * 1.2, 10.0))

    def row(ratio: float) -> int:
        return top + height - round(height * max(0.0, math.log10(ratio)) / decades)

    def write(text: str, x: int, y: int, scale: float = 0.42) -> None:
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(image, text, (x, y), font, scale, (40, 40, 40), 1, cv2.LINE_AA)

    title = f'longest time unvisited / bound ({hours:g} h; 1 = the shortest closed tour)'
    write(title, left, 24, 0.5)
    for mark in (1.0, 1.1, 1.5, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0):
        if mark <= 10**decades:
            cv2.line(image, (left, row(mark)), (image.shape[1] - 20, row(mark)), (225, 225, 225), 1)
            write(f'{mark:g}', left - 42, row(mark) + 4)
    for number, (name, (bound, runs)) in enumerate(results.items()):
        x = left + number * group + gap // 2
        for policy, colour in COLOURS.items():
            upper = min(row(runs[policy].longest / bound), row(1.0) - 2)
            cv2.rectangle(image, (x, upper), (x + bar - 3, row(1.0)), colour, -1)
            x += bar
        write(name, left + number * group + gap // 2, top + height + 22, 0.38)
    x = left
    for policy, colour in COLOURS.items():
        cv2.rectangle(image, (x, top + height + 48), (x + 12, top + height + 60), colour, -1)
        write(policy, x + 17, top + height + 59)
        x += 45 + 9 * len(policy)
    cv2.imwrite(str(path), image)
    print(f'\nplot written to {path}')


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark; return the exit code."""
    parser = sized_parser(
        __doc__,
        quick='small maps, half an hour',
        epilog=(__doc__ or '').partition('\n')[2],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--hours', type=float, help='simulated hours (default 24, or 0.5)')
    parser.add_argument(
        '--graph', nargs='+', metavar='FILE', help="maps in patrolling_sim's format, or folders"
    )
    parser.add_argument('--only', nargs='+', metavar='WORDS', help='maps with these in their names')
    parser.add_argument(
        '--random', type=int, metavar='N', help='random maps, too (default 8, or 3)'
    )
    parser.add_argument(
        '--sizes', nargs='+', type=int, default=SIZES, metavar='N', help='places of random maps'
    )
    parser.add_argument('--table', nargs='+', choices=TABLES, default=TABLES, help='default: all')
    parser.add_argument('--plot', type=Path, metavar='FILE.png', help='draw the ratios')
    options = parser.parse_args(arguments)
    size = options.size
    hours = options.hours or size.of(24.0, 0.5, 0.05)
    try:
        if options.graph:
            chosen = []
            for name in options.graph:
                path = Path(name)
                for file in sorted(path.rglob('*.graph')) if path.is_dir() else [path]:
                    graph = read_patrolling_sim(file, SPEED, EXPLORATION_SECONDS)
                    chosen.append(Map(file.stem, graph, graph.places[0]))
        else:
            words = options.only or ['']
            chosen = [place for place in maps(size) if any(word in place.name for word in words)]
    except (GraphError, OSError, ValueError, yaml.YAMLError) as error:
        print(error, file=sys.stderr)
        return 1
    results = {}
    small = [place for place in chosen if len(place.graph.places) <= LARGE]
    if 'compare' in options.table:
        for place in chosen:
            results[place.name] = (place.graph.tour.bound, compare(place, hours))
    if 'battery' in options.table:
        for place in small:
            strandings(place, hours)
        with_battery(options.random or size.of(100, 8, 1), size.of(20_000, 20_000, 200))
    if 'rules' in options.table:
        many = options.random if options.random is not None else size.of(8, 3, 0)
        sizes, uneven = options.sizes, 4
        graphs = [random_graph(sizes[n % len(sizes)], n, n % uneven == 3) for n in range(many)]
        within = [*(chosen if options.graph else size.of(small, small[:2], small[:1])), *graphs]
        factors = size.of((0.1, 0.5, 1.0, 2.0), (0.1, 1.0), (1.0,))
        within_rules(within, factors, size.of(15.0, 8.0, 2.0), size.of(60_000, 3_000, 100))
    if 'choice' in options.table:
        first_choice(size.of(1000, 1000, 20))
    if 'hours' in options.table:
        month(size.of(31, 3, 1))
    if 'configured' in options.table and not options.graph:
        configured(small, min(hours, 6.0))
    if options.plot:
        plot(options.plot, hours, results)
    return 0


if __name__ == '__main__':
    sys.exit(main())
