"""Draw docs/images/alert.gif anew: a robot detects an open door, and the page calls a person.

    .venv/bin/python docs/makers/alert_picture.py

Needs selenium (in the test extra), Debian's chromium and chromium-driver, and some minutes.
"""

from __future__ import annotations

import io
import signal
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from surveillance_runtime.testing import claim_domain
from tests.launcher.conftest import Started
from tests.operator.browser import Viewer

RULES = 'rules:\n  the door of R1: {door: D1, is: closed}\n'
STAGE = """\
stage:
  shut at first: {at: 1 s, do: door D1 closed}
  somebody opens it: {at: 50 s, do: door D1 open}
"""
BEFORE, AFTER = 20, 12
"""Pictures that are kept of the time before the alert, and taken after it."""
WIDE, HIGH = 1150, 720


def main() -> int:
    """Run a mission, take pictures of its page until the alert, write the animation."""
    frames: list[Image.Image] = []
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / 'watch.yaml').write_text(RULES)
        (Path(folder) / 'stage.yaml').write_text(STAGE)
        words = [str(ROOT / '.venv/bin/python'), str(ROOT / 'launch.py'), '--web', '--record']
        words += [folder, '--domain', str(claim_domain()), '--web-address', '127.0.0.1:0']
        words += ['--watch', f'{folder}/watch.yaml', '--stage', f'{folder}/stage.yaml']
        mission = Started([*words, '-p', 'exploration_seconds:=8.0'])
        try:
            address = mission.until(r'the mission is shown at (\S+)', timeout=300)[1]
            viewer = Viewer(address)
            viewer.size(WIDE, HIGH)
            told, end = 0, time.monotonic() + 600
            while told < AFTER and time.monotonic() < end:
                picture = viewer.driver.get_screenshot_as_png()
                frames.append(Image.open(io.BytesIO(picture)).convert('RGB'))
                told += bool(told or 'D1 is open' in viewer.js('return document.body.innerText'))
                time.sleep(0.9)
            viewer.close()
        finally:
            mission.end(signal.SIGINT, timeout=120)
    kept = frames[-BEFORE - AFTER :]
    small = [frame.resize((760, round(760 * frame.height / frame.width))) for frame in kept]
    palette = small[-1].quantize(64)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in small]
    target = ROOT / 'docs' / 'images' / 'alert.gif'
    drawn[0].save(target, save_all=True, append_images=drawn[1:], duration=600, loop=0)
    print(f'{target}: {target.stat().st_size / 1e6:.1f} MB, {len(drawn)} pictures')
    return 0


if __name__ == '__main__':
    sys.exit(main())
