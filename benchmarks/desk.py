"""What the guard's desk costs and how soon it tells.

    .venv/bin/python benchmarks/desk.py [--quick]

From an incident to the page, its title, its sound and a webhook; a search over a year of events;
viewers that read and that do not, and Stop meanwhile; the first paint of a phone whose processor
is four times slower, and the size of all files. A browser is Debian's chromium.
"""

from __future__ import annotations

import http.client
import http.server
import json
import os
import random
import resource
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.processes import cpu_seconds
from benchmarks.sizes import sized_parser
from benchmarks.tables import table
from surveillance_operator.desk.event_index import EventIndex
from surveillance_operator.desk.live_desk import LiveDesk
from surveillance_operator.notify.calls import open_sinks
from surveillance_operator.notify.incident_keeper import IncidentKeeper
from surveillance_operator.page.access import Links
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Page
from surveillance_runtime.incidents import (
    Cause,
    IncidentPhase,
    IncidentUpdate,
    SeenThing,
    Severity,
)
from tests.operator.browser import CHROMIUM, DRIVER, PHONE, Viewer
from tests.operator.missions import whole

PAGE_FILES = ROOT / 'surveillance_operator/surveillance_operator/page/static'
YEAR = 365 * 86400.0
Row = tuple[str, str, str]
_PAINT = 'return performance.getEntriesByName("first-contentful-paint")[0]?.startTime'
_SEEN = """
window.seen = {};
const note = (what) => { window.seen[what] ??= Date.now(); };
new MutationObserver(() => { if (!document.getElementById('bar').hidden) note('page'); })
  .observe(document.getElementById('bar'), {childList: true, attributes: true, subtree: true});
new MutationObserver(() => { if (document.title.startsWith('(')) note('title'); })
  .observe(document.querySelector('title'), {childList: true});
window.AudioContext = class { currentTime = 0; destination = {};
  createOscillator() { return {frequency: {}, connect: (to) => to, start: () => note('sound'),
    stop() {}}; }
  createGain() { return {gain: {}, connect: (to) => to}; } };
"""


def update(number: int, phase: IncidentPhase) -> IncidentUpdate:
    """Return what an observer tells of a door."""
    cause = Cause('event', str(number))
    seen = SeenThing(number, 'door', 'open', f'D{number}', (1.0, 1.0), 1.0, 'front door')
    text = f'{number}: door D{number} is open'
    return IncidentUpdate(
        phase, cause, Severity.ALARM, text, f'{number:012}', node='observer', finding=seen
    )


def told_rows(folder: Path, times: int) -> list[Row]:
    """Measure from an incident to whoever is told, each anew."""
    if not (CHROMIUM and DRIVER):
        return [('incident to page', 'no Chromium here', '1 s')]
    came: list[float] = []
    os.environ['no_proxy'] = '127.0.0.1'

    class Hook(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            came.append(time.time())
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    hook = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Hook)
    threading.Thread(target=hook.serve_forever, daemon=True).start()
    file = folder / 'notify.yaml'
    file.write_text(f'sinks:\n  hook: {{webhook: "http://127.0.0.1:{hook.server_port}/"}}\n')
    run = folder / 'run'
    sinks = open_sinks(file, run, 'Robot1', print)
    keeper = IncidentKeeper(sinks.tell, run)
    broadcaster = Broadcaster()
    desk = LiveDesk(run, broadcaster.show_desk)
    ended = threading.Event()
    threading.Thread(target=desk.follow, args=(ended.wait,), daemon=True).start()
    page = Page(broadcaster, questions=desk.questions(), actions={'stop': lambda on: ''}, port=0)
    page.start()
    broadcaster.show(whole())
    viewer = Viewer(page.address)
    found: dict[str, list[float]] = {'page': [], 'title': [], 'sound': [], 'webhook': []}
    try:
        viewer.until(lambda: viewer.text('#title').startswith('surveillance'))
        viewer.js(_SEEN)
        viewer.click('#sound')
        for number in range(1, times + 1):
            time.sleep(0.5 + random.random())
            viewer.js('window.seen = {}')
            began, before = time.time(), len(came)
            keeper.hear(update(number, IncidentPhase.BEGIN))
            viewer.until(lambda: len(viewer.js('return window.seen')) == 3, 30)
            for name, at in viewer.js('return window.seen').items():
                found[name].append(at / 1000 - began)
            while len(came) == before and time.time() < began + 60:
                time.sleep(0.01)
            found['webhook'].append(came[-1] - began)
            keeper.carry_out(f'acknowledge {number}')
            viewer.until(lambda: viewer.js('return document.getElementById("bar").hidden'), 30)
    finally:
        viewer.close()
        ended.set()
        page.stop()
        hook.shutdown()
        keeper.close()
        sinks.outbox.close(0.1)
    return [
        (
            f'incident to {name}, median and longest of {times}',
            f'{statistics.median(each):.2f} s, {max(each):.2f} s',
            '1 s',
        )
        for name, each in found.items()
    ]


def search_rows(count: int) -> list[Row]:
    """Measure searches over a year of events."""
    index, now = EventIndex(), time.time()
    begin = now - YEAR
    lines = []
    for number in range(count):
        at = begin + YEAR * number / count
        kind = random.choice(('door', 'person', 'object'))
        entry = {
            'event': 'finding', 'time': at, 'at': at, 'number': number + 1, 'kind': kind,
            'seen': 'seen', 'subject': f'D{number % 9}', 'place': f'R{number % 40}',
            'state': random.choice(('over', 'normal', 'false alarm')), 'severity': number % 4,
            'began': at, 'last': at + 60, 'looks': 2, 'confidence': 0.9, 'rule': 'a rule',
        }  # fmt: skip
        lines.append(json.dumps(entry).encode())
    began = time.perf_counter()
    index.read(lines, 'run')
    read = time.perf_counter() - began
    slowest = 0.0
    for asked in (
        {'text': 'person r7'},
        {'state': 'over', 'severity': 3},
        {'begin': begin, 'end': begin + 86400},
        {'place': 'R3', 'kind': 'door', 'severity': 2},
        {},
    ):
        began = time.perf_counter()
        index.search(now, **asked)  # type: ignore[arg-type]
        slowest = max(slowest, time.perf_counter() - began)
    return [
        (f'search in a year of {count} events, slowest of 5', f'{slowest:.3f} s', '0.3 s'),
        (f'reading {count} events', f'{read:.1f} s', ''),
    ]


def serve() -> None:
    """Serve a page whose robot drives, until the standard input ends."""
    broadcaster = Broadcaster()
    page = Page(
        broadcaster, questions={}, actions={'stop': lambda on: 'stopped'}, port=0, links=Links()
    )
    page.start()
    print(json.dumps([page.port, page.token]), flush=True)
    tick = 0
    threading.Thread(target=lambda: (sys.stdin.read(), sys.exit), daemon=True).start()
    while True:
        tick += 1
        broadcaster.show(whole().having(pose=(tick % 50 / 10, 0.5, 0.0), now=1000.0 + tick / 10))
        time.sleep(0.1)


def crowd_rows(reading: int, silent: int, seconds: float) -> list[Row]:
    """Measure a page with viewers that read and viewers that do not, and Stop meanwhile."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 8192), hard))
    words = [sys.executable, __file__, '--serve']
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    sockets: list[socket.socket] = []
    try:
        assert process.stdout is not None
        port, token = json.loads(process.stdout.readline())

        def join(count: int) -> list[socket.socket]:
            joined = []
            for _ in range(count):
                each = socket.create_connection(('127.0.0.1', port), timeout=30)
                each.sendall(f'GET /events HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n'.encode())
                joined.append(each)
            sockets.extend(joined)
            return joined

        readers = join(reading)
        over = threading.Event()

        def read() -> None:
            while not over.is_set():
                for each in readers:
                    each.setblocking(False)
                    try:
                        while each.recv(65536):
                            pass
                    except OSError:
                        pass
                over.wait(0.2)

        threading.Thread(target=read, daemon=True).start()
        join(silent)
        time.sleep(2.0)
        before = cpu_seconds(process.pid)
        presses = []
        ends = time.monotonic() + seconds
        while time.monotonic() < ends:
            began = time.perf_counter()
            connection = http.client.HTTPConnection('127.0.0.1', port, timeout=30)
            head = {'Origin': f'http://127.0.0.1:{port}', 'Authorization': f'Bearer {token}'}
            connection.request('POST', '/act/stop', '{"on": true}', head)
            assert connection.getresponse().status == 200
            connection.close()
            presses.append(time.perf_counter() - began)
            time.sleep(0.5)
        used = 100 * (cpu_seconds(process.pid) - before) / seconds
        over.set()
    finally:
        for each in sockets:
            each.close()
        process.kill()
        process.wait()
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    who = f'{reading} viewers that read, {silent} that do not'
    return [
        (f"{who}: the page's process", f'{used:.0f} % of a core', '10 %'),
        (f'the same: Stop, longest of {len(presses)}', f'{max(presses):.2f} s', '0.5 s'),
    ]


def paint_rows(times: int) -> list[Row]:
    """Measure the first paint of a phone with a slow processor."""
    size = sum(path.stat().st_size for path in PAGE_FILES.iterdir())
    rows: list[Row] = [('page and editor, all files', f'{size / 1000:.0f} kB', '300 kB')]
    if not (CHROMIUM and DRIVER):
        return [*rows, ('first paint', 'no Chromium here', '1 s')]
    broadcaster = Broadcaster()
    page = Page(broadcaster, questions={}, actions={'stop': lambda on: ''}, port=0)
    page.start()
    broadcaster.show(whole())
    viewer = Viewer('about:blank')
    try:
        viewer.size(*PHONE)
        viewer.driver.execute_cdp_cmd('Emulation.setCPUThrottlingRate', {'rate': 4})
        found = []
        for _ in range(times):
            viewer.driver.get('about:blank')
            viewer.driver.get(page.address)
            viewer.until(lambda: viewer.count('#map .room'), 60)
            found.append(float(viewer.until(lambda: viewer.js(_PAINT), 60)) / 1000)
    finally:
        viewer.close()
        page.stop()
    told = f'{statistics.median(found):.2f} s, {max(found):.2f} s'
    return [
        *rows,
        (f'first paint, processor 4 times slower, median and longest of {times}', told, '1 s'),
    ]


def main() -> None:
    """Print the table."""
    if '--serve' in sys.argv:
        serve()
    size = sized_parser(__doc__, quick='fewer incidents, viewers and seconds').parse_args().size
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        rows += told_rows(Path(folder), size.of(30, 10, 1))
    rows += search_rows(size.of(200_000, 50_000, 500))
    rows += crowd_rows(size.of(200, 200, 5), size.of(1000, 1000, 5), size.of(20.0, 6.0, 1.0))
    rows += paint_rows(size.of(10, 4, 1))
    print(table([('figure', 'measured', 'limit'), *rows]))


if __name__ == '__main__':
    main()
