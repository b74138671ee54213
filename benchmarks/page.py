"""What it costs to see, to record and to replay a mission.

    .venv/bin/python benchmarks/page.py [--quick] [--minutes N]

Starts a whole mission in processes of its own, looks at its page in a real Chromium (where Debian's
chromium and chromium-driver are installed) and with further readers of the same events, and prints
each figure beside its limit. Without `--quick` memory is watched beside a second mission, whose
time runs as fast as it can, for `--minutes` of real time.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage, LaserScan

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.processes import cpu_seconds, end_processes
from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.recording.bag import METADATA, BagWriter, TopicType
from surveillance_operator.recording.runs import find_recordings
from surveillance_operator.recording.schemas import definition
from surveillance_operator.replay import open_player
from surveillance_runtime.testing import claim_domain
from tests.operator.browser import CHROMIUM, DRIVER, Viewer

START = 1e9
"""Of the recordings that are made up here, seconds since 1970."""
FULL_SPEED = ('-p', 'use_sim_time:=true', '-p', 'simulator:speed:=0.0')
PAGE_FILES = ROOT / 'surveillance_operator/surveillance_operator/page/static'

Row = tuple[str, str, str]


@contextlib.contextmanager
def mission(folder: Path, domain: int, *options: str) -> Iterator[tuple[str, dict[str, int]]]:
    """Run a mission; yield its page's address and the processes by name."""
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    words = [sys.executable, str(ROOT / 'launch.py'), '--domain', str(domain), '--web', *options]
    words += ['--web-address', f'127.0.0.1:{port}', '--record', str(folder)]
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder
    )
    found: dict[str, int] = {}
    address = ''
    assert process.stdout is not None
    for line in process.stdout:
        if match := re.search(r'started (\w+) \(process (\d+)\)', line):
            found[match[1]] = int(match[2])
        if match := re.search(r'the mission is shown at (\S+)', line):
            address = match[1]
        if address and 'decision 1' in line:
            break
        if address and 'arrived' in line:
            break
    drain = threading.Thread(target=process.stdout.read, daemon=True)
    drain.start()
    try:
        yield address, found
    finally:
        end_processes([process], 20)


def megabytes(process: int) -> float:
    """Return a process's resident memory."""
    text = Path(f'/proc/{process}/status').read_text()
    match = re.search(r'VmRSS:\s+(\d+)', text)
    assert match
    return int(match[1]) / 1024


def share(processes: list[int], seconds: float) -> list[float]:
    """Return what each process uses of one core, percent."""
    before = [cpu_seconds(each) for each in processes]
    time.sleep(seconds)
    after = [cpu_seconds(each) for each in processes]
    return [100 * (b - a) / seconds for a, b in zip(before, after, strict=True)]


@contextlib.contextmanager
def readers(address: str, count: int) -> Iterator[None]:
    """Read the page's events `count` times over, as browsers do."""
    host, port = re.match(r'http://([^:]+):(\d+)', address).groups()  # type: ignore[union-attr]
    sockets = []
    for _ in range(count):
        each = socket.create_connection((host, int(port)))
        each.sendall(f'GET /events HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n'.encode())
        sockets.append(each)
        threading.Thread(target=_read_all, args=(each,), daemon=True).start()
    try:
        yield
    finally:
        for each in sockets:
            each.close()


def _read_all(connection: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while connection.recv(65536):
            pass


WATCH = """
window.seen = {};
new MutationObserver(() => {
  const found = /event-(\\d+)/.exec(document.getElementById('state').textContent);
  if (found && !(found[1] in seen)) seen[found[1]] = performance.timeOrigin + performance.now();
}).observe(document.getElementById('state'), {childList: true, characterData: true, subtree: true});
"""


def latencies(viewer: Viewer, domain: int, events: int) -> list[float]:
    """Publish events in ROS; return after how long each was in the DOM, milliseconds."""
    os.environ['ROS_DOMAIN_ID'] = str(domain)
    os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
    import rclpy

    from surveillance_interfaces.msg import MissionStatus
    from surveillance_runtime.qos import STATE_QOS

    rclpy.init()
    node = rclpy.create_node('mission_benchmark')
    publisher = node.create_publisher(MissionStatus, 'mission_status', STATE_QOS)
    time.sleep(1.5)
    viewer.js(WATCH)
    sent = {}
    for number in range(events):
        message = MissionStatus(machine='surveillance', state='X', text=f'event-{number}')
        sent[str(number)] = time.time() * 1000
        publisher.publish(message)
        time.sleep(0.08 + random.random() * 0.04)
    time.sleep(0.5)
    seen = viewer.js('return seen')
    node.destroy_node()
    rclpy.try_shutdown()
    return sorted(seen[number] - at for number, at in sent.items() if number in seen)


def heap(viewer: Viewer) -> float:
    """Return the tab's live memory after a collection, megabytes."""
    viewer.driver.execute_cdp_cmd('HeapProfiler.collectGarbage', {})
    return float(viewer.js('return performance.memory.usedJSHeapSize')) / 1e6


def replay_rows(folder: Path, hours: float) -> list[Row]:
    """Measure the replay of a long run, then of its messages alone, as a killed writer leaves them.

    The moments that are jumped to are those that the slider offers: of a recording without a time
    line what has been read so far.
    """
    run = folder / 'run'
    recording = run / 'recording'
    write_messages(recording, hours)
    write_timeline(run / 'timeline.jsonl', hours)
    size = sum(path.stat().st_size for path in recording.iterdir()) / 1e6
    needed = min(600.0, 1800.0 * hours)
    rows = replayed(run, f'replay of {hours:g} h, {size:.0f} MB', needed)
    foreign = folder / 'foreign'
    recording.rename(foreign)
    (foreign / METADATA).unlink()
    for path in foreign.iterdir():
        content_end = path.stat().st_size - 28  # of the footer's fields and the magic
        with open(path, 'rb') as file:
            file.seek(content_end)
            (summary,) = struct.unpack('<Q', file.read(8))
        os.truncate(path, summary)
    return rows + replayed(foreign, 'the same without time line, metadata, index', needed)


def replayed(recording: Path, name: str, needed: float) -> list[Row]:
    """Measure from the command to the first picture, and jumps with lidar and camera.

    Args:
        recording: What is played.
        name: What the row is called.
        needed: Seconds of it that have to be read before somebody jumps.
    """
    with contextlib.ExitStack() as stack:
        began = time.perf_counter()
        player = open_player(
            find_recordings(str(recording), recording.parent), Broadcaster(), stack
        )
        ready = time.perf_counter() - began
        thread = threading.Thread(target=player.run, daemon=True)
        thread.start()
        stack.callback(thread.join)
        stack.callback(player.stop)
        while player.length < needed:
            time.sleep(0.1)

        def jump() -> None:
            player.seek(random.uniform(5.0, player.length - 5.0))
            player.see()
            player.jpeg('')

        seconds = slowest(50, jump)
        hours = player.length / 3600
    return [
        (f'{name}: ready', f'{ready:.2f} s', '2 s'),
        (f'a jump in the {hours:.2g} h read so far, slowest of 50', f'{seconds:.3f} s', '0.3 s'),
    ]


def write_timeline(path: Path, hours: float) -> None:
    """Write a time line as a recorder does: a line each 0.4 s, all parts each minute."""
    parts = {
        'pose': [1.0, 2.0, 0.5],
        'places': {f'R{n}': {'at': [n, n], 'visited': 5.0, 'urgent': False} for n in range(10)},
        'events': [[START, 'arrived in a place']] * 50,
        'trail': [[1.0, 2.0]] * 600,
    }
    with open(path, 'w', encoding='utf-8') as file:
        for tick in range(int(hours * 9000)):
            at, whole = START + tick * 0.4, tick % 150 == 0
            content = parts if whole else {'pose': [tick % 20, 2.0, 0.5]}
            body = json.dumps({'now': at, 'p': content}, separators=(',', ':'))
            file.write(f'{{"t":{at:.3f},"k":{int(whole)},"e":"",{body[1:]}\n')


def write_messages(recording: Path, hours: float) -> None:
    """Write what lidar and camera saw, in segments of an hour.

    Each second is the first one again, with later stamps.
    """
    bag = BagWriter(recording, segment_seconds=1e9)
    jpeg = b'\xff\xd8' + random.randbytes(40_000)
    image = serialize_message(CompressedImage(format='jpeg', data=jpeg))
    for topic, kind in (
        ('/amcl_pose', 'geometry_msgs/msg/PoseWithCovarianceStamped'),
        ('/scan', 'sensor_msgs/msg/LaserScan'),
        ('/camera/rgb/image_raw/compressed', 'sensor_msgs/msg/CompressedImage'),
    ):
        bag.add_topic(TopicType(topic, kind, definition(kind)))
    pose, scan = PoseWithCovarianceStamped(), LaserScan(range_max=9.0, ranges=[2.0] * 360)
    pose.pose.pose.orientation.w = 1.0
    streams = ((serialize_message(pose), '/amcl_pose'), (serialize_message(scan), '/scan'))
    for second in range(int(hours * 3600)):
        if second and second % 3600 == 0:
            bag.close()  # the next message begins a segment
        for tenth in range(0, 10, 2):
            stamp = struct.pack('<iI', second, tenth * 100_000_000)
            at = int((START + second + tenth / 10) * 1e9)
            for message, topic in streams:
                bag.write(topic, message[:4] + stamp + message[12:], at, at)
        at = int((START + second) * 1e9)
        bag.write('/camera/rgb/image_raw/compressed', image, at, at)
        bag.seal()
    bag.close()


def slowest(times: int, do: Callable[[], object]) -> float:
    """Return how long the slowest of some calls took, seconds."""
    took = []
    for _ in range(times):
        began = time.perf_counter()
        do()
        took.append(time.perf_counter() - began)
    return max(took)


def mission_rows(folder: Path, size: Size) -> list[Row]:
    """Measure beside a running mission."""
    seconds = size.of(20.0, 6.0, 0.3)
    rows: list[Row] = []
    domain = claim_domain()
    with mission(folder, domain) as (address, processes):
        page, recorder = processes['mission_page'], processes['mission_recorder']
        time.sleep(size.of(3.0, 3.0, 0.0))
        nobody, recording = share([page, recorder], seconds)
        rows.append(('server, nobody looks', f'{nobody:.1f} % of a core', ''))
        rows.append(('recording, markers and diagnostics', f'{recording:.1f} % of a core', '4 %'))
        for count, limit in ((1, '3 %'), (10, '8 %')):
            with readers(address, count):
                time.sleep(0.5)
                (used,) = share([page], seconds)
            viewers = f'{count} viewer{"" if count == 1 else "s"}'
            rows.append((f'server, {viewers}', f'{used:.1f} % of a core', limit))
        if not (CHROMIUM and DRIVER):
            rows.append(('event in ROS to DOM', 'no Chromium here', '50 ms'))
            return rows
        viewer = Viewer(address)
        try:
            time.sleep(size.of(2.0, 2.0, 0.0))
            count = size.of(500, 100, 10)
            found = latencies(viewer, domain, count)
            if not found:  # on a busy machine the page may not listen yet
                rows.append(('event in ROS to DOM', f'none of {count} was seen', '50 ms'))
                return rows
            for name, at in (('p50', 0.5), ('p99', 0.99)):
                value = found[min(len(found) - 1, int(at * len(found)))]
                limit = '50 ms' if at > 0.9 else ''
                rows.append((f'event in ROS to DOM, {name}', f'{value:.0f} ms', limit))
        finally:
            viewer.close()
    return rows


def memory_rows(folder: Path, minutes: float) -> list[Row]:
    """Watch memory beside a mission whose time runs as fast as it can.

    What grows is fitted to what comes after the first hour of the mission's time, which fills the
    history of an hour; to the last two thirds where there is no second hour. The allocator takes
    and gives back the megabyte of a camera's image, so that a short time shows a slope of that.
    """
    if not (CHROMIUM and DRIVER):
        return [('memory of server and tab', 'no Chromium here', 'flat')]
    seen = []
    with mission(folder, claim_domain(), *FULL_SPEED) as (address, processes):
        viewer = Viewer(address)
        try:
            ends = time.monotonic() + 60 * minutes
            while time.monotonic() < ends:
                time.sleep(5.0)
                hours = float(viewer.js('return mission.now()')) / 3600
                seen.append((hours, megabytes(processes['mission_page']), heap(viewer)))
        finally:
            viewer.close()
    times, *memories = np.array(seen).T
    settled = int(np.searchsorted(times - times[0], 1.0))
    settled = settled if settled < 0.7 * len(times) else len(times) // 3
    rows = []
    for name, memory in zip(('server', 'tab'), memories, strict=True):
        growth = np.polyfit(times[settled:], memory[settled:], 1)[0]
        shown = f'{memory[settled]:.1f} -> {memory[-1]:.1f} MB, {growth:+.2f} MB an hour'
        title = f'memory of the {name}, {times[settled]:.2f} to {times[-1]:.2f} h at full speed'
        rows.append((title, shown, 'flat'))
    return rows


def main() -> None:
    """Print the table."""
    parser = sized_parser(__doc__, quick='an hour is replayed, memory is not watched')
    parser.add_argument('--minutes', type=float, default=10.0, help='to watch memory; 0: not')
    options = parser.parse_args()
    size = sum(path.stat().st_size for path in PAGE_FILES.iterdir())
    rows: list[Row] = [('page, all files', f'{size / 1000:.0f} kB', '300 kB')]
    with tempfile.TemporaryDirectory() as folder:
        rows += replay_rows(Path(folder), options.size.of(24.0, 1.0, 0.02))
        rows += mission_rows(Path(folder), options.size)
        if options.size is Size.FULL:
            rows += memory_rows(Path(folder), options.minutes)
    print(table([('figure', 'measured', 'limit'), *rows]))


if __name__ == '__main__':
    main()
