"""Draw docs/images/patrol.gif anew: the live page's map while a robot patrols.

    python docs/makers/moving_picture.py

Needs selenium (in the test extra), Debian's chromium and chromium-driver, and a minute.
"""

from __future__ import annotations

import io
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

ROOT = Path(__file__).resolve().parents[2]
ADDRESS = '127.0.0.1:8097'
FRAMES = 56
PAUSE = 0.45
SPEED = 10.0


def main() -> int:
    """Run a mission, take pictures of its map, write the animation."""
    words = ['--web', '--web-address', ADDRESS, '--domain', '63', '--record', 'off']
    words += ['--params', str(ROOT / 'config' / 'fast.yaml'), '-p', f'simulator:speed:={SPEED}']
    mission = subprocess.Popen(
        [sys.executable, str(ROOT / 'launch.py'), *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which('chromium'))
    for argument in ('headless=new', 'no-sandbox', 'disable-gpu', 'window-size=900,1000'):
        options.add_argument(f'--{argument}')
    try:
        time.sleep(12.0)
        driver = webdriver.Chrome(options=options, service=Service(shutil.which('chromedriver')))
        driver.get(f'http://{ADDRESS}/')
        time.sleep(4.0)
        place = driver.find_element('css selector', '#map')
        frames = []
        for _ in range(FRAMES):
            frames.append(Image.open(io.BytesIO(place.screenshot_as_png)).convert('RGB'))
            time.sleep(PAUSE)
        driver.quit()
    finally:
        mission.send_signal(signal.SIGINT)
        mission.wait()
    small = [frame.resize((440, round(440 * frame.height / frame.width))) for frame in frames]
    palette = small[-1].quantize(48)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in small]
    target = ROOT / 'docs' / 'images' / 'patrol.gif'
    drawn[0].save(target, save_all=True, append_images=drawn[1:], duration=180, loop=0)
    print(f'written: {target} ({target.stat().st_size // 1024} kB)')
    return 0


if __name__ == '__main__':
    sys.exit(main())
