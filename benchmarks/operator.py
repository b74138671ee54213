"""What it costs to see, to record and to replay a mission.

    .venv/bin/python benchmarks/operator.py [--quick] [--minutes N]

Starts a whole mission in processes of its own, looks at its page in a real Chromium (where Debian's
chromium and chromium-driver are installed) and with further readers of the same events, and prints
each figure beside its limit. `--minutes` sets how long memory is watched.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOMAIN = 93
TICKS = os.sysconf('SC_CLK_TCK')
PAGE_FILES = ROOT / 'surveillance_operator/surveillance_operator/page/static'

Row = tuple[str, str, str]


@contextlib.contextmanager
def mission(folder: Path) -> Iterator[tuple[str, dict[str, int]]]:
    """Run a mission; yield its page's address and the processes by name."""
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    words = [sys.executable, str(ROOT / 'launch.py'), '--domain', str(DOMAIN), '--web']
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
        process.send_signal(signal.SIGINT)
        process.wait(20)


def cpu_seconds(process: int) -> float:
    """Return the processor time that a process has used, seconds."""
    parts = Path(f'/proc/{process}/stat').read_text().rsplit(')', 1)[1].split()
    return (int(parts[11]) + int(parts[12])) / TICKS


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


def browser(address: str) -> Any:
    """Open the page in a Chromium; None where there is none."""
    binary, driver = shutil.which('chromium'), shutil.which('chromedriver')
    if not binary or not driver:
        return None
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for argument in ('headless=new', 'no-sandbox', 'disable-gpu', 'disable-dev-shm-usage'):
        options.add_argument(f'--{argument}')
    opened = webdriver.Chrome(options=options, service=Service(driver))
    opened.get(address)
    return opened


WATCH = """
window.seen = {};
new MutationObserver(() => {
  const found = /event-(\\d+)/.exec(document.getElementById('state').textContent);
  if (found && !(found[1] in seen)) seen[found[1]] = performance.timeOrigin + performance.now();
}).observe(document.getElementById('state'), {childList: true, characterData: true, subtree: true});
"""


def latencies(opened: Any, events: int) -> list[float]:
    """Publish events in ROS; return after how long each was in the DOM, milliseconds."""
    os.environ['ROS_DOMAIN_ID'] = str(DOMAIN)
    os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
    import rclpy

    from surveillance_interfaces.msg import MissionStatus
    from surveillance_runtime.qos import STATE_QOS

    rclpy.init()
    node = rclpy.create_node('mission_benchmark')
    publisher = node.create_publisher(MissionStatus, 'mission_status', STATE_QOS)
    time.sleep(1.5)
    opened.execute_script(WATCH)
    sent = {}
    for number in range(events):
        message = MissionStatus(machine='surveillance', state='X', text=f'event-{number}')
        sent[str(number)] = time.time() * 1000
        publisher.publish(message)
        time.sleep(0.08 + random.random() * 0.04)
    time.sleep(0.5)
    seen = opened.execute_script('return seen')
    node.destroy_node()
    rclpy.try_shutdown()
    return sorted(seen[number] - at for number, at in sent.items() if number in seen)


def heap(opened: Any) -> float:
    """Return the tab's live memory after a collection, megabytes."""
    opened.execute_cdp_cmd('HeapProfiler.collectGarbage', {})
    return float(opened.execute_script('return performance.memory.usedJSHeapSize')) / 1e6


def replay_rows(folder: Path) -> list[Row]:
    """Measure a time line of 24 hours."""
    from surveillance_operator.recording.timeline import Timeline

    path = folder / 'timeline.jsonl'
    parts = {
        'pose': [1.0, 2.0, 0.5],
        'places': {f'R{n}': {'at': [n, n], 'visited': 5.0, 'urgent': False} for n in range(10)},
        'events': [['12:00:00', 'arrived in a place']] * 50,
        'trail': [[1.0, 2.0]] * 600,
    }
    with open(path, 'w', encoding='utf-8') as file:
        for tick in range(24 * 3600 * 5 // 2):
            at, whole = 1e9 + tick * 0.4, tick % 150 == 0
            content = parts if whole else {'pose': [tick % 20, 2.0, 0.5]}
            body = json.dumps({'now': at, 'p': content}, separators=(',', ':'))
            file.write(f'{{"t":{at:.3f},"k":{int(whole)},"e":"",{body[1:]}\n')
    began = time.perf_counter()
    line = Timeline(path)
    ready = time.perf_counter() - began
    jumps = []
    for _ in range(50):
        moment = random.uniform(line.times[0], line.times[-1])
        began = time.perf_counter()
        line.at(moment)
        jumps.append(time.perf_counter() - began)
    size = path.stat().st_size / 1e6
    return [
        (f'replay of 24 h ({size:.0f} MB) ready', f'{ready:.2f} s', '2 s'),
        ('a jump in it, slowest of 50', f'{1000 * max(jumps):.0f} ms', '300 ms'),
    ]


def mission_rows(folder: Path, quick: bool, minutes: float) -> list[Row]:
    """Measure beside a running mission."""
    seconds = 6.0 if quick else 20.0
    rows: list[Row] = []
    with mission(folder) as (address, processes):
        page, recorder = processes['mission_page'], processes['mission_recorder']
        time.sleep(3.0)
        nobody, recording = share([page, recorder], seconds)
        rows.append(('server, nobody looks', f'{nobody:.1f} % of a core', ''))
        rows.append(('recording, markers and diagnostics', f'{recording:.1f} % of a core', '4 %'))
        with readers(address, 1):
            time.sleep(0.5)
            rows.append(('server, 1 viewer', f'{share([page], seconds)[0]:.1f} % of a core', '3 %'))
        with readers(address, 10):
            time.sleep(0.5)
            rows.append(
                ('server, 10 viewers', f'{share([page], seconds)[0]:.1f} % of a core', '8 %')
            )
        opened = browser(address)
        if opened is None:
            rows.append(('event in ROS to DOM', 'no Chromium here', '50 ms'))
            return rows
        try:
            time.sleep(2.0)
            found = latencies(opened, 100 if quick else 500)
            for name, at in (('p50', 0.5), ('p99', 0.99)):
                value = found[min(len(found) - 1, int(at * len(found)))]
                limit = '50 ms' if at > 0.9 else ''
                rows.append((f'event in ROS to DOM, {name}', f'{value:.0f} ms', limit))
            before = megabytes(page), heap(opened)
            time.sleep(5.0 if quick else 60.0 * minutes)
            after = megabytes(page), heap(opened)
            for name, a, b in zip(('server', 'tab'), before, after, strict=True):
                rows.append((f'memory of the {name}', f'{a:.1f} -> {b:.1f} MB', 'flat'))
        finally:
            opened.quit()
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--quick', action='store_true')
    parser.add_argument('--minutes', type=float, default=10.0, help='how long to watch memory')
    options = parser.parse_args()
    size = sum(path.stat().st_size for path in PAGE_FILES.iterdir())
    rows: list[Row] = [('page, all files', f'{size / 1000:.0f} kB', '150 kB')]
    with tempfile.TemporaryDirectory() as folder:
        rows += replay_rows(Path(folder))
        rows += mission_rows(Path(folder), options.quick, options.minutes)
    width = max(len(name) for name, _, _ in rows)
    print(f'{"figure":<{width}}  {"measured":>20}  {"limit":>8}')
    for name, measured, limit in rows:
        print(f'{name:<{width}}  {measured:>20}  {limit:>8}')


if __name__ == '__main__':
    main()
