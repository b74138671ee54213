"""A notification, and the other ends of sinks, for tests."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from surveillance_operator.notify.notification import Notification
from surveillance_runtime.incidents import (
    Cause,
    IncidentPhase,
    IncidentUpdate,
    SeenThing,
    Severity,
)

SECRET = 'hunter2hunter2'


def news(key: str = 'k1', **fields: Any) -> Notification:
    values = {
        'text': '3: door D1 is ajar in C1',
        'kind': 'event',
        'name': '3',
        'node': 'observer',
        'robot': 'Robot1',
        'over': False,
        'at': 1000.0,
    }
    return Notification(key, **{**values, **fields})


class Hook:
    """A webhook's other end: keeps what is posted, answers what it is told to."""

    def __init__(self) -> None:
        self.posts: list[tuple[dict[str, str], dict[str, Any]]] = []
        self.answers: list[int] = []
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers['Content-Length']))
                outer.posts.append((dict(self.headers), json.loads(body)))
                status = outer.answers.pop(0) if outer.answers else 204
                self.send_response(status)
                if status == 302:
                    self.send_header('Location', f'{outer.address}/elsewhere')
                self.send_header('Content-Length', '0')
                self.end_headers()

            def log_message(self, *_: Any) -> None:
                pass

        self.server = ThreadingHTTPServer(('127.0.0.1', 0), Handler)
        self.address = f'http://127.0.0.1:{self.server.server_port}'
        threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True).start()


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def of_door(**more: Any) -> IncidentUpdate:
    """Return the incident of a door that the observer saw."""
    return IncidentUpdate(
        *(
            IncidentPhase.BEGIN,
            Cause('event', '3'),
            Severity.ALARM,
            '3: door D1 is ajar in C1',
            'a1',
        ),
        node='observer',
        place='C1',
        finding=SeenThing(3, 'door', 'ajar', 'D1', rule='D1 is shut'),
        **more,
    )


def evidence(folder: Path, name: str) -> Path:
    picture = np.random.default_rng(0).integers(0, 255, (120, 160, 3)).astype(np.uint8)
    path = folder / name
    cv2.imwrite(str(path), picture)
    return path
