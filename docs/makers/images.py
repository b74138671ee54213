"""Draw the images of the documentation again: the places, a run, a run as `launch.py watch` shows
it, and what the camera sees.

    python docs/makers/images.py

The camera's pictures come from the topic camera/rgb/image_raw of a running simulator.
"""

from __future__ import annotations

import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'benchmarks'))

from builtin_interfaces.msg import Duration
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont
from rich.console import Console
from rich.style import Style
from rich.terminal_theme import MONOKAI
from sensor_msgs.msg import Image, JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from whole_stack import Stack

from state_machines.ros import ServiceCaller
from surveillance_interfaces.srv import PlaceObstacle, SetDoor, SetMarker
from surveillance_operator import map_command
from surveillance_operator.watch.view import KEY_NOTE, MissionView
from surveillance_runtime import node_table
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.robot_arm import ARM

IMAGES = ROOT / 'docs' / 'images'
PATROL_SECONDS = 1500.0
WATCH_SECONDS = 163.0


def places() -> None:
    """Draw every place."""
    for name in ('seven_rooms', 'patrol_world', 'office'):
        place = ROOT / 'config' / f'{name}.yaml'
        assert map_command.main([str(place), '-o', str(IMAGES / f'{name}.png')]) == 0


def run() -> None:
    """Patrol the seven rooms for a while and draw the run."""
    place = ROOT / 'config' / 'seven_rooms.yaml'
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / 'run.jsonl'
        stack = Stack(
            place, {'robot_behavior': {'record': str(record)}, 'simulator': {'top_speed': 60.0}}
        )
        stack.start()
        try:
            while stack.robot.time < PATROL_SECONDS:
                threading.Event().wait(0.2)
        finally:
            stack.close()
        arguments = [str(place), '--record', str(record), '-o', str(IMAGES / 'run.png')]
        assert map_command.main(arguments) == 0


def watch() -> None:
    """Patrol with a closed door and an obstacle, and draw the terminal of whoever watches."""
    nodes = [*(node.name for node in node_table.select('SIMULATED')), 'mission_view']
    stack = Stack(
        ROOT / 'config' / 'seven_rooms.yaml',
        {'simulator': {'speed': 4.0}, 'battery_controller': {'battery_initial_value': 70}},
        nodes=nodes,
    )
    stack.start()
    try:
        for kind, name, request in (
            (SetDoor, 'set_door', SetDoor.Request(door='D5', open=False)),
            (
                PlaceObstacle,
                'place_obstacle',
                PlaceObstacle.Request(name='barrel', x=12.0, y=8.5, radius=0.25),
            ),
        ):
            ServiceCaller(stack.observer, kind, f'simulation/{name}').call(request, timeout=20.0)
        while stack.robot.time < WATCH_SECONDS:
            threading.Event().wait(0.2)
        view: Any = stack.nodes['mission_view']
        screenshot(MissionView(view.see(), note=KEY_NOTE), 110, 34).save(
            IMAGES / 'watch.png', optimize=True
        )
    finally:
        stack.close()


def screenshot(view: MissionView, columns: int, rows: int) -> Picture.Image:
    """Return a terminal's picture; blocks fill their cells, which fonts leave gaps between."""
    console = Console(width=columns, height=rows, color_system='truecolor', force_terminal=True)
    fonts = [ImageFont.truetype(f'DejaVuSansMono{kind}.ttf', 15) for kind in ('', '-Bold')]
    wide, high = 9, 18
    picture = Picture.new('RGB', (columns * wide, rows * high), MONOKAI.background_color)
    draw = ImageDraw.Draw(picture)
    blocks = {' ': (0, 0), '█': (0, high), '▀': (0, high // 2), '▄': (high // 2, high)}
    texts = []
    for row, line in enumerate(console.render_lines(view, console.options.update(height=rows))):
        column = 0
        for segment in line:
            style = segment.style or Style.null()
            ink, paper = _colours(style)
            for character in segment.text:
                x, y = column * wide, row * high
                column += 1
                draw.rectangle((x, y, x + wide - 1, y + high - 1), paper)
                top, bottom = blocks.get(character, (0, 0))
                if bottom:
                    draw.rectangle((x, y + top, x + wide - 1, y + bottom - 1), ink)
                elif character != ' ':
                    texts.append(((x, y), character, ink, fonts[bool(style.bold)]))
    for text in texts:
        draw.text(*text)
    return picture


def _colours(style: Style) -> tuple[tuple[int, ...], tuple[int, ...]]:
    ink = style.color.get_truecolor(MONOKAI) if style.color else MONOKAI.foreground_color
    paper = MONOKAI.background_color
    if style.bgcolor:
        paper = style.bgcolor.get_truecolor(MONOKAI, foreground=False)
    if style.dim:
        return tuple((2 * a + b) // 3 for a, b in zip(ink, paper, strict=True)), tuple(paper)
    return tuple(ink), tuple(paper)


class Photographer:
    """Turns the arm of a simulated robot and keeps what its camera publishes."""

    def __init__(self, stack: Stack) -> None:
        self._node = stack.observer
        self._arm = self._node.create_publisher(JointTrajectory, 'arm/joint_trajectory', 1)
        self._arrived = threading.Condition()
        self._joints: list[float] = []
        self._moving = True
        self._picture: Any = None
        self._node.create_subscription(JointState, 'joint_states', self._on_joints, SENSOR_QOS)
        self._node.create_subscription(Image, 'camera/rgb/image_raw', self._on_picture, SENSOR_QOS)

    def take(self, pan: float, tilt: float) -> Picture.Image:
        """Return what the camera sees with the arm turned to `pan` and the camera tilted, rad."""
        wanted = (pan, *ARM.home[1:3], ARM.home[3] + tilt, 0.0)
        point = JointTrajectoryPoint(positions=wanted, time_from_start=Duration(sec=1))
        while not self._arm.get_subscription_count():
            threading.Event().wait(0.05)
        self._arm.publish(JointTrajectory(joint_names=ARM.names, points=[point]))
        with self._arrived:
            self._arrived.wait_for(lambda: self._is_at(wanted), 30.0)
            for _ in range(2):
                self._picture = None
                self._arrived.wait_for(lambda: self._picture is not None, 30.0)
            message = self._picture
        pixels = np.frombuffer(bytes(message.data), np.uint8)
        return Picture.fromarray(pixels.reshape(message.height, message.width, 3))

    def _is_at(self, wanted: tuple[float, ...]) -> bool:
        return bool(self._joints) and np.allclose(self._joints, wanted, atol=1e-3)

    def _on_joints(self, message: JointState) -> None:
        with self._arrived:
            self._joints = list(message.position)
            self._arrived.notify_all()

    def _on_picture(self, message: Image) -> None:
        with self._arrived:
            self._picture = message
            self._arrived.notify_all()


def camera() -> None:
    """Take six pictures in the room with the markers."""
    stack = Stack(
        ROOT / 'config' / 'patrol_world.yaml',
        {'simulator': {'speed': 5.0}},
        nodes=['simulator'],
    )
    photographer = Photographer(stack)
    stack.start()
    try:
        calls = {
            kind: ServiceCaller(stack.observer, kind, f'simulation/{name}')
            for kind, name in (
                (SetDoor, 'set_door'),
                (PlaceObstacle, 'place_obstacle'),
                (SetMarker, 'set_marker'),
            )
        }
        calls[SetDoor].call(SetDoor.Request(door='D6', open=False), timeout=20.0)
        calls[PlaceObstacle].call(
            PlaceObstacle.Request(name='barrel', x=-0.9, y=6.3, radius=0.25), timeout=20.0
        )
        pictures = [
            photographer.take(0.15, 0.0),
            photographer.take(1.3, -0.1),
            photographer.take(2.45, -0.1),
            photographer.take(-2.2, 0.2),
            photographer.take(-1.1, 0.0),
        ]
        request = SetMarker.Request(name='m13', state=SetMarker.Request.BROKEN)
        calls[SetMarker].call(request, timeout=20.0)
        pictures.append(photographer.take(1.6, -0.05))
    finally:
        stack.close()
    width, height = pictures[0].size
    sheet = Picture.new('RGB', (3 * width + 16, 2 * height + 8), 'white')
    for number, picture in enumerate(pictures):
        sheet.paste(picture, ((number % 3) * (width + 8), (number // 3) * (height + 8)))
    sheet.resize((sheet.width // 2, sheet.height // 2), Picture.Resampling.LANCZOS).save(
        IMAGES / 'camera.jpg', quality=88
    )


if __name__ == '__main__':
    for draw in [globals()[name] for name in sys.argv[1:]] or [places, run, watch, camera]:
        draw()
