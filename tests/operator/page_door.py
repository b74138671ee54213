"""A page with every role, and who has pressed what."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from surveillance_operator.page.access import Links
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.server import Document, Page


class Door:
    """A page with every role, and who has pressed what."""

    def __init__(self, folder: Path) -> None:
        self.pressed: list[tuple[str, str, str]] = []
        self.links = Links(folder / 'links.json')
        self.page = Page(
            Broadcaster(),
            questions={'search': lambda text='': {'ok': True, 'text': text}},
            actions={
                'stop': lambda on=True: 'stopped',
                'alarm': self.alarm,
                'go': lambda place: f'to {place}',
            },
            documents={'metrics': lambda: Document(b'up 1\n', 'text/plain; version=0.0.4')},
            port=0,
            links=self.links,
            pressed=lambda who, name, _fields, said: self.pressed.append((who.name, name, said)),
        )
        self.page.start()

    def alarm(self, verb: str, key: str, note: str = '', by: str = '') -> str:
        """Answer an alarm."""
        return f'{verb} by {by}'

    def send(self, path: str, token: str = '', **fields: Any) -> tuple[int, Any]:
        request = urllib.request.Request(f'http://127.0.0.1:{self.page.port}{path}')
        if token:
            request.add_header('Authorization', f'Bearer {token}')
        if path.startswith('/act/'):
            request.data = json.dumps(fields).encode()
            request.add_header('Origin', f'http://127.0.0.1:{self.page.port}')
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                text = answer.read().decode()
                return answer.status, json.loads(text) if text.startswith('{') else text
        except urllib.error.HTTPError as error:
            text = error.read().decode()
            return error.code, json.loads(text) if text.startswith('{') else text
