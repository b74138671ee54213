"""A mission on two hosts while the link between them fails: `campaign.py --network`.

The simulated robot and its controllers are on one host, ontology and behaviour on the other. First
the visits are counted over an undisturbed link, then over one that loses and delays frames, then
the hosts are cut off from each other, at any moment of a leg, and joined again. What counts then is
when the mission goes on: when it decides anew, or the leg ends that it was on. How long the first
visit takes, whose drive depends on the place, is told as well.
"""

from __future__ import annotations

import random
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.hosts import Host, Network, may_be_made
from surveillance_runtime.testing import claim_domain

ROOT = Path(__file__).resolve().parents[1]
ROBOT = ('simulator', 'motion_controller', 'planner_controller', 'battery_controller')
DESK = ('armor_server', 'ontology_map_builder', 'robot_behavior')
PATIENCE = 120.0
"""Seconds that the next visit may take."""

LOSS, DELAY = 0.2, 0.2
"""Of a frame in either direction: the chance that it is lost, and seconds that it takes."""
ALLOWED_SHARE, ALLOWED_SECONDS = 0.5, 5.0
"""What a campaign that passed has reached: share of undisturbed visits, seconds to go on."""


@dataclass
class LinkResults:
    """What the campaign saw.

    Attributes:
        undisturbed, disturbed: Visits a minute.
        lost_frames: Share that was lost while the link was disturbed.
        visits: Seconds from each joining to the first visit after it.
        waits: Seconds until the mission went on.
    """

    undisturbed: float = 0.0
    disturbed: float = 0.0
    lost_frames: float = 0.0
    visits: list[float] = field(default_factory=list)
    waits: list[float] = field(default_factory=list)

    def passed(self) -> bool:
        """Tell whether the figures are as good as they have to be."""
        enough = self.disturbed >= ALLOWED_SHARE * self.undisturbed
        return enough and max(self.waits, default=0.0) <= ALLOWED_SECONDS

    def rows(self) -> list[tuple[str, str]]:
        """Return the table to print."""
        shown = ', '.join(
            f'{wait:.1f} s, {visit:.1f} s'
            for wait, visit in zip(self.waits, self.visits, strict=True)
        )
        return [
            ('visits a minute, undisturbed', f'{self.undisturbed:.1f}'),
            (f'with {LOSS:.0%} loss, {DELAY * 1000:.0f} ms each way', f'{self.disturbed:.1f}'),
            ('frames lost meanwhile', f'{self.lost_frames:.0%}'),
            ('joined again: mission goes on, first visit', shown or 'not tried'),
        ]


class LinkCampaign:
    """One mission on two hosts.

    Args:
        scratch: Folder for logs and runs.
        seed: Of the losses.
        events: Reads the events of a run's mission record.
    """

    def __init__(
        self, scratch: Path, seed: int, events: Callable[[Path], Sequence[dict[str, Any]]]
    ) -> None:
        if not may_be_made():
            raise SystemExit('campaign: --network needs root, unshare and /dev/net/tun')
        self._scratch = scratch
        self._events = events
        self._chance = random.Random(seed)
        self._domain = claim_domain()
        self.network = Network(2, seed)
        robot, desk = self.network.hosts
        self._launchers = [
            self._launch(robot, 'robot', ROBOT),
            self._launch(desk, 'desk', DESK),
        ]

    def _launch(self, host: Host, name: str, nodes: Sequence[str]) -> subprocess.Popen[bytes]:
        words = ['--network', '--domain', str(self._domain), '--record', str(self._scratch / name)]
        words += ['--only', ','.join(nodes)]
        with (self._scratch / f'{name}.log').open('wb') as log:
            return subprocess.Popen(
                host.words(sys.executable, str(ROOT / 'launch.py'), *words),
                cwd=ROOT,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def run(self, seconds: float, cuts: int, cut_seconds: float) -> LinkResults:
        """Go through the phases; `seconds` for each of the first two."""
        results = LinkResults()
        self._await_visit()
        results.undisturbed = self._rate(seconds)
        network = self.network
        network.loss, network.delay = LOSS, DELAY
        network.passed = network.lost = 0
        results.disturbed = self._rate(seconds)
        results.lost_frames = network.lost / max(1, network.lost + network.passed)
        network.loss = network.delay = 0.0
        for _ in range(cuts):
            self._await_visit()
            time.sleep(self._chance.uniform(0.0, 10.0))
            network.cut = True
            time.sleep(cut_seconds)
            network.cut = False
            joined = time.time()
            self._await_visit()
            results.visits.append(time.time() - joined)
            steps = [float(each['time']) for each in (*self._of('decision'), *self._of('visit'))]
            results.waits.append(min(step for step in steps if step > joined) - joined)
        return results

    def _of(self, kind: str) -> list[dict[str, Any]]:
        return [
            event
            for folder in (self._scratch / 'desk').glob('*')
            for event in self._events(folder)
            if event.get('event') == kind
        ]

    def _await_visit(self) -> None:
        before, late = len(self._of('visit')), time.monotonic() + PATIENCE
        while len(self._of('visit')) == before:
            if time.monotonic() > late:
                raise SystemExit(f'campaign: no visit in {PATIENCE:g} s, see {self._scratch}')
            time.sleep(0.1)

    def _rate(self, seconds: float) -> float:
        """Return visits a minute."""
        before = len(self._of('visit'))
        time.sleep(seconds)
        return 60.0 * (len(self._of('visit')) - before) / seconds

    def close(self) -> None:
        """Stop both and take the hosts down."""
        for launcher in self._launchers:
            launcher.terminate()
        for launcher in self._launchers:
            try:
                launcher.wait(20)
            except subprocess.TimeoutExpired:
                launcher.kill()
        self.network.close()
