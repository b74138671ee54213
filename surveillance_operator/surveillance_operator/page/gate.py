"""Who a request is from, and whether it may look at all: tokens, cookies, origins."""

from __future__ import annotations

import ipaddress
import secrets
import socket
from typing import Any
from urllib.parse import urlsplit

from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

from surveillance_operator.page.access import HOLDER, Links, PageUser
from surveillance_runtime import parameter_checks

COOKIE_SECONDS = 30 * 86400


class Gate:
    """Lets requests in.

    Args:
        host, port: Where the page listens.
        origin: What browsers know the page by behind a proxy; empty: there is no proxy.
        token: What gives access to all; empty: one is made.
        links: Who has links of their own; None: nobody.

    Raises:
        ValueError: The origin is none.
    """

    def __init__(self, host: str, port: int, origin: str, token: str, links: Links | None) -> None:
        if expected := parameter_checks.web_origin(origin):
            raise ValueError(f'{origin!r}: expected {expected}')
        self.token = token or secrets.token_urlsafe(24)
        self._host, self._port, self._links = host, port, links
        self._origin = origin.rstrip('/').lower()
        self.is_local = is_loopback(host) and not self._origin
        self._cookie = f'mission_{port}'

    @property
    def address(self) -> str:
        """Where to look, without the token."""
        if self._origin:
            return f'{self._origin}/'
        shown = f'[{self._host}]' if ':' in self._host else self._host
        if self._host in ('0.0.0.0', '::'):
            shown = socket.gethostname()
        return f'http://{shown}:{self._port}/'

    def refusal(self, request: Request) -> tuple[int, str] | None:
        """Say with which status and why a request may not even look; None when it may."""
        try:
            host = urlsplit(f'//{request.headers.get("host", "")}').hostname or ''
        except ValueError:  # brackets that are not closed
            return 400, 'the Host of this request is no name and no address'
        # Another site's name that leads here would make a browser send that site's requests.
        if self.is_local and host != 'localhost' and not is_loopback(host):
            return 403, f'host {host[:80]!r} is not this page'
        if not self.is_local and self.person(request) is None:
            return 403, 'a token is needed: open the address that the mission printed'
        return None

    def person(self, request: Request) -> PageUser | None:
        """Return who has sent a request; None: somebody without a valid token."""
        given = request.query_params.get('token') or request.cookies.get(self._cookie, '')
        # A program, as one that reads the metrics, has no cookies.
        kind, _, bearer = request.headers.get('authorization', '').partition(' ')
        given = given or (bearer if kind.lower() == 'bearer' else '')
        if secrets.compare_digest(given.encode(), self.token.encode()):
            return HOLDER
        return None if self._links is None or not given else self._links.person(given)

    def entered(self, request: Request) -> Response:
        """Answer a request that brings a token: it becomes a cookie."""
        if self.person(request) is None:
            return PlainTextResponse('this token is not valid any more', 403)
        answer = RedirectResponse('/', 303)
        answer.set_cookie(
            self._cookie,
            request.query_params['token'],
            httponly=True,
            samesite='strict',
            secure=self._origin.startswith('https:'),
            max_age=COOKIE_SECONDS,
        )
        return answer

    def foreign(self, request: Request) -> str:
        """Return why a request is of another site; empty: it is of this page."""
        origin = request.headers.get('origin', '')
        if origin == (self._origin or f'http://{request.headers.get("host", "")}'):
            return ''
        # The browser says where the person looks: the one value that the option has to have.
        known = urlsplit(origin).scheme in ('http', 'https') and len(origin) < 300
        hint = f'; behind a proxy start with --web-origin {origin}' if known else ''
        return f'refused: not from this page{hint}'

    def link_actions(self) -> dict[str, Any]:
        """Return what an operator may do about links, by name."""
        links = self._links
        if links is None:
            return {}

        def make_link(name: str, role: str) -> Any:
            """Make a link for somebody: viewer, guard or operator."""
            token = links.make(name, role)
            link = f'{self.address}?token={token}'
            return {'ok': True, 'text': f'link of {name}', 'link': link}

        def revoke_link(name: str) -> str:
            """Take somebody's link back."""
            links.revoke(name)
            return f'the link of {name} is taken back'

        return {
            'links': lambda: {'ok': True, 'links': links.listed()},
            'make_link': make_link,
            'revoke_link': revoke_link,
        }


def is_loopback(host: str) -> bool:
    """Tell whether a host is this machine's own."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == 'localhost'
