#!/usr/bin/env python3
"""Stop a robot while something else is wrong at the same time, and print one table.

    .venv/bin/python benchmarks/faults.py --quick
    .venv/bin/python benchmarks/faults.py --only stops --presses 200

Rows (`--only` takes their names):

- `callbacks`: what the dearest call of any topic, service or action of a simulated patrol costs,
  for each field drawn log-uniformly (`callback_budget`).
- `stops`: a whole mission drives; one or two of its processes get SIGKILL or SIGSTOP at random,
  and a moment before or after that somebody presses Stop. Lost is a press after which the robot
  still moves after ten seconds, or moves again before it is released.
- `viewers`, `half-open`: the same press by the page's HTTP, beside viewers that never read, and
  beside connections that ask for nothing while the page has 1,024 descriptors.
- `restarts`: a stopped robot's launcher is ended in four ways and started again in twelve.
- `publisher`: until a second publisher on the base's topic is named.
- `thread`: until a node whose receiving threads stand is back (ptrace).
- `action`: until a goal ends whose server's process was killed.

Distances are those of the simulator's ground truth. The load of the machine is printed with them.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import gc
import http.client
import itertools
import json
import math
import os
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from geometry_msgs.msg import Twist
from std_msgs.msg import Bool

from benchmarks.callback_budget import BUDGET, Cost, Draws, Prober, heard_by
from benchmarks.campaign import Launcher, Watcher
from benchmarks.machine_faults import FrozenThreads, SmallDisk
from benchmarks.processes import end_processes, memory_mb
from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from benchmarks.whole_stack import Stack
from state_machines.exceptions import CallError, UnavailableError
from state_machines.ros import GoalCaller
from surveillance_interfaces.action import FollowPath
from surveillance_interfaces.msg import Incident
from surveillance_operator.stop_button import StopButton
from surveillance_runtime.incident_topic import INCIDENTS_QOS
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.testing import claim_domain

STANDS, DRIVES = 0.02, 0.3
"""Below the first speed the robot stands, above the second it drives, m/s."""
LOST_AFTER, HELD_FOR = 10.0, 2.0
"""Seconds until a robot that was stopped has to stand, and for which it then has to."""
PATIENCE = 90.0
VICTIMS = (
    *('collision_monitor', 'motion_controller', 'robot_behavior', 'planner_controller'),
    *('armor_server', 'ontology_map_builder', 'mission_page', 'battery_controller', 'alarm'),
)
SERVER = """
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from surveillance_interfaces.action import FollowPath
from state_machines.ros import GoalServer

rclpy.init()
node = Node('server')
GoalServer(node, FollowPath, 'follow_path', lambda _goal, run: run.interrupt.wait())
executor = SingleThreadedExecutor()
executor.add_node(node)
executor.spin()
"""

Row = tuple[str, str, str]


@dataclass
class Press:
    """What came of one press.

    Attributes:
        seconds, metres: Until the robot stood; infinite: it was lost.
        answer: Seconds until the answer.
        what: What was wrong at the same time.
    """

    seconds: float
    metres: float
    answer: float
    what: str = ''


class Mission:
    """A mission that drives all the time, and who watches it.

    Args:
        folder: For its files.
        words: Further options of the launcher.
        on: Makes a command another one.
        state: The user's state folder; None: one in the folder.
    """

    def __init__(
        self,
        folder: Path,
        words: Sequence[str] = (),
        on: Callable[..., list[str]] = lambda *command: list(command),
        state: Path | None = None,
    ) -> None:
        self.folder, self._on = folder, on
        self.domain = claim_domain()
        self.state = state or folder / 'state'
        self.token = 'faults'
        (folder / 'token').write_text(self.token + '\n')
        (folder / 'token').chmod(0o600)
        with socket.socket() as free:
            free.bind(('127.0.0.1', 0))
            self.port = free.getsockname()[1]
        self.words = [
            *('--web-control', '--web-address', f'127.0.0.1:{self.port}'),
            *('-p', f'mission_page:token_file:={folder / "token"}'),
            *('-p', 'exploration_seconds:=0.0', '--record', str(folder / 'runs'), *words),
        ]
        self.watcher = Watcher(self.domain)
        self.node = PatrolNode('faults', context=self.watcher.context, use_global_arguments=False)
        self.incidents: list[Incident] = []
        self.node.create_subscription(Incident, 'incidents', self.incidents.append, INCIDENTS_QOS)
        self.stopped: list[bool] = []
        self.node.create_subscription(
            Bool, 'stopped', lambda told: self.stopped.append(told.data), STATE_QOS
        )
        self.watcher._spinning.executor.add_node(self.node)
        self.button = StopButton(self.node)
        self.launcher = self.launch(self.words)

    def launch(self, words: Sequence[str]) -> Launcher:
        """Start the launcher."""
        # A stop of these robots stays theirs, on the disk and in memory.
        memory = self.state.with_name(f'{self.state.name}_memory')
        memory.mkdir(parents=True, exist_ok=True)
        environ = {'XDG_STATE_HOME': str(self.state), 'XDG_RUNTIME_DIR': str(memory)}
        return Launcher(words, self.domain, self.folder / 'launch.log', environ, self._on)

    def speed(self) -> float:
        """Return the speed over the last positions, m/s."""
        last = self.watcher.truth[-6:]
        if len(last) < 6 or last[-1][0] <= last[0][0]:
            return math.nan
        return math.dist(last[0][1:], last[-1][1:]) / (last[-1][0] - last[0][0])

    def until(self, holds: Callable[[], bool], patience: float = PATIENCE) -> bool:
        """Wait; return whether it came to hold."""
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if holds():
                return True
            time.sleep(0.01)
        return False

    def drives(self) -> bool:
        """Wait until the robot drives."""
        return self.until(lambda: self.speed() > DRIVES)

    def press(self, press: Callable[[], object], what: str = '') -> Press:
        """Press, and look how the robot comes to stand."""
        answered = [math.inf]
        begun, at = time.monotonic(), self.watcher.truth[-1]

        def work() -> None:
            with contextlib.suppress(CallError, OSError, http.client.HTTPException):
                press()
                answered[0] = time.monotonic() - begun

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        # By the robot's clock: a watcher that is late does not count.
        stood = self.until(lambda: self.speed() < STANDS, LOST_AFTER)
        end = next(
            (
                after
                for before, after in itertools.pairwise(
                    [each for each in list(self.watcher.truth) if each[0] >= at[0]]
                )
                if math.dist(before[1:], after[1:]) < STANDS * max(after[0] - before[0], 1e-9)
            ),
            self.watcher.truth[-1],
        )
        thread.join(LOST_AFTER)
        stays = self.watcher.truth[-1]
        time.sleep(HELD_FOR)
        moved = math.dist(stays[1:], self.watcher.truth[-1][1:]) > 0.05
        if not stood or moved:
            return Press(math.inf, math.inf, answered[0], what)
        return Press(end[0] - at[0], math.dist(at[1:], end[1:]), answered[0], what)

    def release(self) -> bool:
        """Release the robot; return whether it may be taken for released."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            with contextlib.suppress(CallError):
                if self.button.press(False).startswith('the robot may move again'):
                    return True
                if self.stopped and not self.stopped[-1]:
                    return True
            time.sleep(0.2)
        return False

    def post_stop(self) -> None:
        """Press Stop on the page, as a program does."""
        page = http.client.HTTPConnection('127.0.0.1', self.port, timeout=LOST_AFTER)
        headers = {
            'Authorization': f'Bearer {self.token}',
            'Origin': f'http://127.0.0.1:{self.port}',
            'Content-Type': 'application/json',
        }
        page.request('POST', '/act/stop', json.dumps({'on': True}), headers)
        answer = page.getresponse()
        text = answer.read().decode()
        page.close()
        if answer.status != 200:
            raise OSError(text)

    def close(self) -> None:
        """End it."""
        self.launcher.end()
        self.watcher._spinning.executor.remove_node(self.node)
        self.node.stop()
        self.watcher.close()


@contextlib.contextmanager
def mission(words: Sequence[str] = (), **options: object) -> Iterator[Mission]:
    """Run a mission until the block ends."""
    folder = Path(tempfile.mkdtemp(prefix='faults-'))
    running = Mission(folder, words, **options)  # type: ignore[arg-type]
    try:
        if not running.drives():
            log = (folder / 'launch.log').read_text('utf-8', 'replace').splitlines()
            raise SystemExit('faults: the mission does not drive:\n' + '\n'.join(log[-20:]))
        yield running
    finally:
        running.close()
        shutil.rmtree(folder, ignore_errors=True)


def told(presses: Sequence[Press]) -> str:
    """Return what came of presses in words."""
    good = [each for each in presses if math.isfinite(each.seconds)]
    lost = len(presses) - len(good)
    if not good:
        return f'{lost} of {len(presses)} lost'
    seconds, metres = (sorted(getattr(p, name) for p in good) for name in ('seconds', 'metres'))
    answers = sorted(each.answer for each in presses)
    middle, late = len(good) // 2, math.ceil(0.95 * len(good)) - 1
    return (
        f'{lost} of {len(presses)} lost; {metres[middle]:.2f} m, at most {metres[-1]:.2f}; '
        f'{seconds[middle]:.2f} s, 95 % {seconds[late]:.2f}, at most {seconds[-1]:.2f}; '
        f'answer {answers[len(answers) // 2]:.2f} s, at most {answers[-1]:.2f}'
    )


@dataclass
class Chosen:
    """How much is measured."""

    size: Size
    seed: int
    presses: int
    draws: int
    done: list[Row] = field(default_factory=list)


def stops(chosen: Chosen) -> list[Row]:
    """Press Stop while processes die and freeze."""
    chance = random.Random(chosen.seed)
    presses: dict[int, list[Press]] = {0: [], 1: [], 2: []}
    with mission() as running:
        for number in range(chosen.presses):
            running.drives()
            count = 0 if number < min(10, chosen.presses // 4) else chance.choice((1, 1, 2))
            victims = chance.sample([v for v in VICTIMS if v in running.launcher.processes], count)
            signals = [chance.choice((signal.SIGKILL, signal.SIGSTOP)) for _ in victims]
            what = ', '.join(f'{v} {s.name}' for v, s in zip(victims, signals, strict=True))
            first = chance.random() < 0.7
            begun = time.monotonic()

            def hit(
                victims: Sequence[str] = victims, signals: Sequence[signal.Signals] = signals
            ) -> None:
                for victim, number in zip(victims, signals, strict=True):
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(running.launcher.processes[victim], number)

            if first:
                hit()
                time.sleep(chance.uniform(0.0, 0.3))
            else:
                threading.Timer(chance.uniform(0.0, 0.3), hit).start()
            if running.speed() < DRIVES:
                # It stands already, for who drove it is gone: nothing is measured, all is held.
                what += ' (stood)'
            pressed = running.press(lambda: running.button.press(True), what)
            presses[count].append(pressed)
            print(
                f'  {number + 1}: {pressed.seconds:.2f} s {pressed.metres:.2f} m '
                f'answer {pressed.answer:.2f} s: {what or "nothing wrong"}',
                flush=True,
            )
            for each in victims:
                running.until(lambda v=each: running.watcher.answers(v))
            if not running.release():
                print('  not released', flush=True)
            del begun
    return [
        (f'Stop, {count} processes dead or frozen', told(each), '.25 m, .5 s; 0 lost')
        for count, each in presses.items()
        if each
    ]


def _connected(port: int, count: int, words: bytes) -> list[socket.socket]:
    opened = []
    for _ in range(count):
        each = socket.socket()
        each.setblocking(False)
        with contextlib.suppress(BlockingIOError, OSError):
            each.connect(('127.0.0.1', port))
        opened.append(each)
    time.sleep(1.0)
    for each in opened:
        with contextlib.suppress(OSError):
            each.send(words)
    return opened


def _http_rows(
    chosen: Chosen, name: str, connections: int, words: bytes, limit: int, aim: str
) -> Row:
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    limit = min(limit, most)

    def limited(*command: str) -> list[str]:
        return ['prlimit', f'--nofile={limit}:{limit}', *command]

    presses = []
    with mission(on=limited) as running:
        for number in range(chosen.size.of(11, 4, 1)):
            running.drives()
            # Who was cut off comes back; the first press is without any.
            opened = _connected(running.port, connections if number else 0, words)
            time.sleep(1.0)
            pressed = running.press(running.post_stop)
            print(
                f'  {len(opened)}: {pressed.seconds:.2f} s {pressed.metres:.2f} m '
                f'answer {pressed.answer:.2f} s',
                flush=True,
            )
            if number or chosen.size is Size.SMOKE:
                presses.append(pressed)
            running.release()
            for each in opened:
                each.close()
    return name, told(presses), aim


def viewers(chosen: Chosen) -> list[Row]:
    """Press Stop on the page beside viewers that never read."""
    count = chosen.size.of(1000, 1000, 20)
    request = b'GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n'
    return [_http_rows(chosen, f'Stop, {count} viewers never read', count, request, 65536, '.5 s')]


def half_open(chosen: Chosen) -> list[Row]:
    """Press Stop on the page beside connections that ask for nothing."""
    count = chosen.size.of(1100, 1100, 20)
    name = f'Stop, {count} half-open connections, 1,024 descriptors'
    return [_http_rows(chosen, name, count, b'GET / HTTP/1.1\r\nHost: ', 1024, '.5 s')]


WAYS: tuple[tuple[str, ...], ...] = (
    (),
    ('--fresh',),
    ('--resume',),
    ('--composed',),
    ('--behaviour', 'patrol'),
    ('--map', str(ROOT / 'config' / 'patrol_world.yaml')),
    ('-p', 'exploration_seconds:=1.0'),
    ('--record', 'OTHER'),
    ('--record', 'off'),
    ('--without', 'battery_controller'),
    ('--memory', '4096'),
    ('--log-level', 'warn'),
)
ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)


def restarts(chosen: Chosen) -> list[Row]:
    """End a stopped robot's launcher, and start it again in other ways."""
    chance = random.Random(chosen.seed)
    all_trials = [(way, end, full) for way in WAYS for end in ENDS for full in (False, True)]
    chance.shuffle(all_trials)
    trials = all_trials[: chosen.size.of(len(all_trials), 2, 1)]
    drove, unkept, silent = [], 0, 0
    disk = None
    state = Path(tempfile.mkdtemp(prefix='faults-state-'))
    if SmallDisk.may_be_made():
        disk = SmallDisk(state, 2)
    else:
        trials = [each for each in trials if not each[2]]
    with mission(state=state) as running:
        for way, end, full in trials:
            running.drives()
            if full and disk is not None:
                disk.fill()
            try:
                answer = running.button.press(True)
            except CallError as error:
                answer = str(error)
            running.until(lambda: bool(running.stopped) and running.stopped[-1])
            running.launcher.process.send_signal(end)
            running.launcher.process.wait(60)
            gone = running.launcher.processes.values()
            running.until(lambda g=gone: not any(os.path.exists(f'/proc/{pid}') for pid in g))
            running.stopped.clear()
            truths = len(running.watcher.truth)
            words = [w.replace('OTHER', str(running.folder / 'other')) for w in way]
            running.launcher = running.launch([*running.words, *words])
            came = running.until(
                lambda n=truths: bool(running.stopped) and len(running.watcher.truth) > n + 50
            )
            drives = running.until(lambda: running.speed() > 0.05, 5.0)
            name = f'{" ".join(way) or "the same"} after {end.name}{", disk full" * full}'
            if not came:
                silent += 1
                print(f'  {name}: did not come up', flush=True)
            elif drives or not running.stopped[-1]:
                if 'not over a restart' in answer:
                    unkept += 1
                else:
                    drove.append(name)
                print(f'  {name}: drives; at the press: {answer}', flush=True)
            else:
                print(f'  {name}: stopped', flush=True)
            if disk is not None:
                disk.free()
            running.release()
    said = f'{len(drove)} of {len(trials)} drive' + (f': {"; ".join(drove)}' if drove else '')
    said += f'; {unkept} more of which the answer said that it is not kept'
    if silent:
        said += f'; {silent} did not come up'
    return [('Stop over restarts: 12 ways x 4 ends, disk full or not', said, '0')]


def publisher(chosen: Chosen) -> list[Row]:
    """Publish on the base's topic until somebody says so."""
    times = []
    with mission() as running:
        for number in range(chosen.size.of(10, 3, 1)):
            stranger = PatrolNode(
                f'stranger{number}', context=running.watcher.context, use_global_arguments=False
            )
            begun = time.monotonic()
            made = stranger.create_publisher(Twist, 'cmd_vel_monitored', 1)
            named = running.until(
                lambda n=number: any(f'/stranger{n} commands' in i.text for i in running.incidents)
            )
            times.append(time.monotonic() - begun if named else math.inf)
            stranger.destroy_publisher(made)
            stranger.destroy_node()
    return [('second publisher named', _seconds(times), '2 s')]


def thread(chosen: Chosen) -> list[Row]:
    """Let the threads stand with which a node receives."""
    noticed, back = [], []
    with mission() as running:
        for victim in ('motion_controller', 'collision_monitor', 'armor_server')[
            : chosen.size.of(3, 1, 1)
        ]:
            begun = time.monotonic()
            pid = running.launcher.processes[victim]
            try:
                frozen = FrozenThreads(pid, 'dds.udp')
            except OSError as error:
                return [('frozen receive thread', f'not measured: {error}', '10 s')]
            running.until(lambda v=victim, p=pid: running.launcher.processes[v] != p)
            noticed.append(time.monotonic() - begun)
            frozen.close()
            running.until(lambda v=victim: running.watcher.answers(v, 0.5))
            back.append(time.monotonic() - begun)
    words = f'noticed after {_seconds(noticed)}; back after {_seconds(back)}'
    return [('frozen receive thread', words, '10 s')]


def action(chosen: Chosen) -> list[Row]:
    """Kill the process of an action's server while its goal runs."""
    watcher = Watcher(claim_domain())
    caller = GoalCaller(watcher.node, FollowPath, 'follow_path')
    domain = str(watcher.context.get_domain_id())
    times = []
    for _ in range(chosen.size.of(10, 3, 1)):
        process = subprocess.Popen(
            [sys.executable, '-c', SERVER], env={**os.environ, 'ROS_DOMAIN_ID': domain}
        )
        killed = [math.inf]

        def kill(process: subprocess.Popen[bytes] = process, killed: list[float] = killed) -> None:
            time.sleep(2.0)
            killed[0] = time.monotonic()
            process.kill()

        timer = threading.Thread(target=kill)
        try:
            while not caller.is_ready() or not caller._liveliness._living:
                time.sleep(0.02)
            timer.start()
            caller.run(FollowPath.Goal(), accept_timeout=30.0)
        except UnavailableError:
            times.append(time.monotonic() - killed[0])
        finally:
            timer.join()
            end_processes([process], 1)
    watcher.close()
    return [('action server killed: goal ends', _seconds(times), '3 s')]


def callbacks(chosen: Chosen) -> list[Row]:
    """Call everything that a patrol's nodes take with strange values."""
    before = os.getcwd()
    folder = tempfile.mkdtemp(prefix='faults-')
    os.environ['XDG_STATE_HOME'] = os.environ['XDG_RUNTIME_DIR'] = folder
    os.chdir(folder)
    stack = Stack(ROOT / 'config' / 'seven_rooms.yaml')
    costs: list[Cost] = []
    hangs = []
    grown: list[tuple[float, str]] = []
    try:
        heard = [each for node in stack.nodes.values() for each in heard_by(node)]
        stack.start()
        time.sleep(chosen.size.of(20.0, 5.0, 2.0))
        prober = Prober(
            stack._spinner.executor,
            Draws(random.Random(chosen.seed), chosen.size.of(1_000_000, 100_000, 1000)),
        )
        gc.disable()
        begun = time.monotonic()
        held = _held_mb()
        for each in heard:
            if time.monotonic() - begun > chosen.size.of(math.inf, 25.0, 5.0):
                break
            try:
                costs.append(prober.probe(each, chosen.draws))
            except TimeoutError as error:
                hangs.append(f'{each.node} {each.name}: {error}')
                break
            gc.collect()
            before_it, held = held, _held_mb()
            grown.append((held - before_it, f'{each.node} {each.name}'))
    finally:
        gc.enable()
        os.chdir(before)
        if not hangs:
            stack.close()
        shutil.rmtree(folder, ignore_errors=True)
    costs.sort(key=lambda cost: -cost.seconds / cost.heard.budget)
    for cost in costs[:12]:
        print(
            f'  {1e3 * cost.seconds:8.1f} ms of {1e3 * cost.heard.budget:.0f}: {cost.heard.node} '
            f'{cost.heard.name}, {cost.path} = {cost.what}',
            flush=True,
        )
    broken = [cost for cost in costs if cost.broken]
    small = max((cost.seconds for cost in costs if cost.heard.budget == BUDGET), default=0.0)
    large = max((cost.seconds for cost in costs if cost.heard.budget != BUDGET), default=0.0)
    most, where = max(grown, default=(0.0, 'nothing'))
    later = sum(each for each, _ in grown[len(grown) // 2 :])
    words = (
        f'{1e3 * small:.1f} ms ({1e3 * large:.1f}), {len(broken)} over the budget, '
        f'{len(hangs)} hangs; {len(costs)} of {len(heard)} names, '
        f'{sum(cost.calls for cost in costs)} calls, {chosen.draws} of a field'
    )
    flat = (
        f'{sum(each for each, _ in grown):+.0f} MB, in the second half {later:+.0f}; most by '
        f'{where}: {most:+.0f}'
    )
    return [
        ('dearest callback, every field log-uniform', words, '10 ms (50); 0 hangs'),
        ('the same: memory of the process', flat, 'flat'),
        *((f'hang: {hang}', '', '') for hang in hangs),
    ]


def _held_mb() -> float:
    """Return the memory of this process without what the allocator keeps for later, MB."""
    trim = getattr(ctypes.CDLL(None), 'malloc_trim', None)  # of glibc
    if trim is not None:
        trim(0)
    return memory_mb(os.getpid())


def _seconds(times: Sequence[float]) -> str:
    if not times:
        return 'never'
    return f'{sorted(times)[len(times) // 2]:.1f} s, at most {max(times):.1f} ({len(times)})'


ROWS: dict[str, Callable[[Chosen], list[Row]]] = {
    'callbacks': callbacks,
    'action': action,
    'publisher': publisher,
    'thread': thread,
    'stops': stops,
    'viewers': viewers,
    'half-open': half_open,
    'restarts': restarts,
}
QUICK = ('callbacks', 'action')


def main(words: Sequence[str] | None = None) -> int:
    """Measure and print the table."""
    parser = sized_parser(
        __doc__,
        quick='some draws and the killed server',
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--only', nargs='+', choices=ROWS, metavar='ROW', help=', '.join(ROWS))
    parser.add_argument('--presses', type=int, help='of the row stops (default: 200)')
    parser.add_argument('--draws', type=int, help='of each field (default: 10,000)')
    parser.add_argument('--seed', type=int, help='of the randomness; default: another each time')
    given = parser.parse_args(words)
    size = given.size
    seed = given.seed if given.seed is not None else random.randrange(10**6)
    chosen = Chosen(
        size, seed, given.presses or size.of(200, 6, 1), given.draws or size.of(10_000, 1, 1)
    )
    print(f'seed {seed}', flush=True)
    names = given.only or (ROWS if size is Size.FULL else QUICK)
    for name in names:
        before = os.getloadavg()[0]
        rows = ROWS[name](chosen)
        load = f'load {before:.0f} to {os.getloadavg()[0]:.0f}'
        chosen.done += [(each[0], f'{each[1]} ({load})', each[2]) for each in rows]
        for each in rows:
            print(f'{each[0]}: {each[1]} ({load})', flush=True)
    print(table([('figure', 'reached', 'aim'), *chosen.done]))
    return 0


if __name__ == '__main__':
    sys.stdout.flush()
    code = main()
    sys.stdout.flush()
    os._exit(code)  # what hangs in a node that was probed does not keep this process
