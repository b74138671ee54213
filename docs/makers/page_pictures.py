"""Draws the pictures of the page in docs/images anew, from missions of both behaviours.

    .venv/bin/python docs/makers/page_pictures.py [FOLDER]

Needs Chromium and its driver (apt-get install chromium chromium-driver).
"""

from __future__ import annotations

import contextlib
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from surveillance_runtime.testing import claim_domain
from tests.launcher.conftest import Started
from tests.operator.browser import DESK, PHONE, Viewer

WAIT = 600.0
"""Longest wait for anything to be seen, on a busy machine, seconds."""


@contextlib.contextmanager
def page(behaviour: str, speed: float) -> Iterator[Viewer]:
    """Open the page of a mission in a browser."""
    with tempfile.TemporaryDirectory() as runs:
        words = [str(ROOT / '.venv/bin/python'), str(ROOT / 'launch.py'), '--web-control']
        words += ['--behaviour', behaviour, '--record', runs, '--domain', str(claim_domain())]
        words += ['--web-address', '127.0.0.1:0', '-p', 'use_sim_time:=true']
        started = Started([*words, '-p', f'simulator:speed:={speed}'])
        try:
            told = r'the mission is shown at (\S+) \(its token is in ([^)]+)\)'
            shown = started.until(told, timeout=WAIT)
            viewer = Viewer(f'{shown[1]}?token={Path(shown[2]).read_text().strip()}')
            try:
                yield viewer
            finally:
                viewer.close()
        finally:
            started.end(signal.SIGINT, timeout=60)


def main() -> None:
    """Draw all pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / 'docs/images'
    folder.mkdir(parents=True, exist_ok=True)
    with page('patrol', 1.0) as viewer:
        viewer.until(lambda: viewer.count('[data-marker]'), WAIT)
        viewer.js("document.querySelector('#camera-section').scrollIntoView()")
        viewer.until(
            lambda: viewer.js("return document.querySelector('#camera').naturalWidth"), WAIT
        )
        viewer.picture(folder / 'page_scan.png', *DESK)
    with page('surveillance', 10.0) as viewer:
        viewer.until(lambda: viewer.count('[data-place]') == 7, WAIT)
        viewer.until(lambda: viewer.text('#decision-line').startswith('decision 20'), WAIT)
        viewer.js("document.querySelector('[data-place=R3]').dispatchEvent(new Event('click'))")
        viewer.until(lambda: viewer.count('[data-fact]'), WAIT)
        viewer.click('[data-fact] summary')
        viewer.until(lambda: viewer.count('.proof li'), WAIT)
        viewer.click('#why-not')
        viewer.until(lambda: viewer.text('#answer'), WAIT)
        viewer.js('location.hash = "#/engineer"')
        viewer.picture(folder / 'page_engineer.png', *DESK)
        viewer.js('location.hash = "#/desk"')
        for name, size in (('phone', PHONE), ('desk', DESK)):
            for dark in (False, True):
                file = folder / f'page_{name}{"_dark" if dark else ""}.png'
                viewer.picture(file, *(size if name == 'desk' else (size[0], 1900)), dark=dark)


if __name__ == '__main__':
    main()
