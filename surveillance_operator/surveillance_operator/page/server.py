"""The page's web server: who may see it, who may act, and what each address answers.

On the loopback address everybody on this machine may look. Elsewhere a token is needed: the address
that is printed holds it once, and it becomes a cookie. Whatever changes something needs the token
in any case, comes from the page's own origin, and only where control was switched on. Further links
have tokens and roles of their own (`page.access`).

`/ask/NAME`, `/act/NAME`, `/get/NAME` and `/events` are the page's own interface; `/openapi.json`
describes it as it is served (`page.api`).

Behind a proxy that adds TLS, browsers know the page by another origin (`https://robot.example.org`),
which is told by its option. Then everybody needs the token, also to look: requests of anybody come
from the proxy, which is on this machine.
"""

from __future__ import annotations

import asyncio
import inspect
import logging
import socket
import threading
import time
from collections.abc import AsyncIterator, Callable, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import (
    JSONResponse,
    PlainTextResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send

from state_machines.exceptions import CallError
from strict_files.files import in_one_line
from strict_files.regular_files import parse_json
from strict_files.suggestions import nearest
from surveillance_operator.page.access import (
    GUARD,
    HOLDER,
    NOBODY,
    OPERATOR,
    Links,
    PageUser,
    least_role,
)
from surveillance_operator.page.api import description
from surveillance_operator.page.broadcaster import Broadcaster
from surveillance_operator.page.connections import (
    HEADER_TIME,
    SEND_BUFFER,
    BoundedConnection,
    most_connections,
)
from surveillance_operator.page.doorman import Doorman
from surveillance_operator.page.gate import Gate

STATIC = Path(__file__).with_name('static')
LONGEST_BODY = 65_536
HEADERS = {
    'Content-Security-Policy': "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cache-Control': 'no-store',
    # Each request comes by a connection of its own: which loop serves it is seen by its beginning.
    'Connection': 'close',
}

DOCUMENT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
UNTOLD = ('drive', 'links', 'sinks')
"""Actions that are in no log: a stick that is held sends ten a second."""
LINK_PERIOD = 2.0
"""Seconds after which it is seen that a link was taken back, in a stream that goes on."""
STOPPING = ('stop', 'fleet')
"""Actions that have threads of their own: whatever else keeps the others busy, a robot stops."""


Action = Callable[..., Any]
"""Takes a request's fields by name; returns what came of it, or raises `ValueError` or `CallError`
with one line. One that takes `by` is told who sends it."""
Pressed = Callable[[PageUser, str, Mapping[str, Any], str], object]
"""Told of an action: who, its name, its fields, what came of it."""


Evidence = Callable[[str, str, str, bool], bytes | None]
"""Takes the name of a kept picture, its robot, its run, and whether it leaves this machine."""


@dataclass(frozen=True)
class Document:
    """A file that is made when somebody asks for it.

    Attributes:
        content: What is in it.
        kind: Its media type.
        name: What a browser saves it as; empty: it shows it.
    """

    content: bytes
    kind: str
    name: str = ''


class Page:
    """What is served.

    Args:
        broadcaster: What viewers see.
        questions: Answered to whoever may look, by name.
        actions: Done for whoever may act, by name; none without control.
        picture: The image of a robot's camera as JPEG, or None when there is none; of a robot that
            is alone the name is empty.
        evidence: A kept picture as JPEG, or None.
        host, port: Where to listen; port 0 takes any.
        origin: What browsers know the page by behind a proxy, as ``https://robot.example.org``;
            empty: there is no proxy.
        token: What gives access; one is made unless given.
        replay: Whether a recording is shown: then anybody who may look may move in time.
        front: The document at the address itself, a file of `static`.
        longest: Bytes of the longest request of an action that may have more than others.
        report: Told one line about a request that failed, and about what was no request of HTTP;
            keep the number of lines small, anybody can send them.
        documents: Files that are made for whoever may look, by name; one that takes `leaves` is
            told whether what it gives leaves this machine.
        links: Who has links of their own; None: nobody.
        pressed: Told of each action that somebody was allowed.
        crowded: Told True where a connection made room for another, False where there are fewer.

    Raises:
        OSError: The address cannot be used.
        ValueError: The origin is none.
    """

    def __init__(
        self,
        broadcaster: Broadcaster,
        *,
        questions: Mapping[str, Action],
        actions: Mapping[str, Action],
        picture: Callable[[str], bytes | None] = lambda _robot: None,
        evidence: Evidence = lambda _name, _robot, _run, _leaves: None,
        host: str = '127.0.0.1',
        port: int = 8080,
        origin: str = '',
        token: str = '',
        replay: bool = False,
        front: str = 'index.html',
        longest: Mapping[str, int] | None = None,
        report: Callable[[str], Any] = lambda _: None,
        documents: Mapping[str, Action] | None = None,
        links: Links | None = None,
        pressed: Pressed = lambda _who, _action, _fields, _said: None,
        crowded: Callable[[bool], object] = lambda _is: None,
    ) -> None:
        self._broadcaster = broadcaster
        self._pressed = pressed
        self._documents = documents or {}
        self._picture = picture
        self._evidence_of = evidence
        self._replay = replay
        self._front = front
        self._longest = longest or {}
        self._socket = _bound(host, port)
        self.port: int = self._socket.getsockname()[1]
        self._gate = Gate(host, self.port, origin, token, links)
        self.token = self._gate.token
        own = self._gate.link_actions() if actions and not replay else {}
        self._questions, self._actions = questions, {**actions, **own}
        routes = [
            Route('/', self._index),
            Route('/edit', self._edit),
            Route('/events', self._events),
            Route('/camera.jpg', self._camera),
            Route('/evidence/{name}', self._evidence),
            Route('/ask/{name}', self._ask),
            Route('/get/{name}', self._get),
            Route('/metrics', self._metrics),
            Route('/openapi.json', self._openapi),
            Route('/act/{name}', self._act, methods=['POST']),
            Mount('/static', StaticFiles(directory=STATIC)),
        ]
        app = _Guard(Starlette(routes=routes), self._gate.refusal, report)
        _report_for_uvicorn(report)
        most = most_connections()
        # What cannot wait has a loop of its own: a thousand viewers do not delay it.
        self._loops = {urgent: _Loop(app, most, crowded) for urgent in (False, True)}
        self._door = Doorman(self._socket, _is_urgent, self._lead, most // 2, HEADER_TIME, crowded)
        self._thread: threading.Thread | None = None
        self._stop_threads = ThreadPoolExecutor(8, 'stop')

    @property
    def needs_token(self) -> bool:
        """Whether some of what it offers needs the token."""
        return not self._gate.is_local or bool(self._actions and not self._replay)

    @property
    def address(self) -> str:
        """Where to look; with the token where one is needed: it is for no log."""
        return self.open_address + (f'?token={self.token}' if self.needs_token else '')

    @property
    def open_address(self) -> str:
        """Where to look, without the token."""
        return self._gate.address

    def start(self) -> None:
        """Serve on a thread of its own."""
        self._thread = threading.Thread(target=self.run, name='page', daemon=True)
        self._thread.start()

    def run(self) -> None:
        """Serve until `stop`, or a signal on the main thread."""
        urgent = threading.Thread(target=self._loops[True].run, name='page stop', daemon=True)
        urgent.start()
        self._door.start()
        self._loops[False].run()

    def _lead(self, peer: socket.socket, urgent: bool) -> None:
        self._loops[urgent].take(peer)

    def stop(self) -> None:
        """End the streams and the server."""
        self._broadcaster.close()
        self._stop_threads.shutdown(wait=False)
        self._door.stop()
        for each in self._loops.values():
            each.server.should_exit = True
        if self._thread is not None:
            self._thread.join(3.0)

    async def _index(self, request: Request) -> Response:
        if 'token' in request.query_params:
            return self._gate.entered(request)
        return self._document(request, self._front)

    async def _edit(self, request: Request) -> Response:
        if 'place' not in self._questions:
            return PlainTextResponse('there is no place to be edited here', 404)
        return self._document(request, 'edit.html')

    def _document(self, request: Request, name: str) -> Response:
        text = (STATIC / name).read_text(encoding='utf-8')
        kind = 'replay' if self._replay else 'live'
        person = self._gate.person(request) or NOBODY
        may_act = bool(self._actions) and (self._replay or person.may(GUARD))
        is_operator = self._replay or person.may(OPERATOR)
        may_edit = may_act and is_operator and 'place' in self._questions
        shown = {
            'kind': kind,
            'control': int(may_act and is_operator),
            'guard': int(may_act),
            'who': escape(person.name, quote=True),
            'role': person.role,
            'edit': int(may_edit),
            'imports': int(may_edit and 'import_map' in self._actions),
            'live': int(self._front != name),
            'past': int('past' in self._questions),
            'search': int('search' in self._questions),
            'baseline': int('baseline' in self._questions),
            'mutes': int('mute' in self._actions),
            'sinks': int('sinks' in self._actions),
            'rules': int('rule' in self._actions),
            'people': int('links' in self._actions and is_operator),
            'reports': int('report' in self._documents),
        }
        attributes = ' '.join(f'data-{name}="{value}"' for name, value in shown.items())
        text = text.replace('data-kind=""', attributes)
        return Response(text, media_type='text/html')

    async def _events(self, request: Request) -> Response:
        stream = self._broadcaster.stream(request.query_params.get('robot'))
        person = self._gate.person(request)
        if person not in (None, HOLDER):
            stream = self._while_valid(stream, request)
        return StreamingResponse(stream, media_type='text/event-stream')

    async def _while_valid(
        self, stream: AsyncIterator[str], request: Request
    ) -> AsyncIterator[str]:
        """Yield what a stream does until the link of who reads it is taken back."""
        looked = time.monotonic()
        async for each in stream:
            if (now := time.monotonic()) - looked > LINK_PERIOD:
                looked = now
                if self._gate.person(request) is None:
                    return
            yield each

    async def _camera(self, request: Request) -> Response:
        image = await run_in_threadpool(self._picture, request.query_params.get('robot', ''))
        if image is None:
            return Response(status_code=204)
        return Response(image, media_type='image/jpeg')

    async def _evidence(self, request: Request) -> Response:
        name = request.path_params['name']
        robot, run = (request.query_params.get(each, '') for each in ('robot', 'run'))
        leaves = not self._gate.is_local
        image = await run_in_threadpool(self._evidence_of, name, robot, run, leaves)
        if image is None:
            return PlainTextResponse('no such picture', 404)
        return Response(image, media_type='image/jpeg')

    async def _ask(self, request: Request) -> Response:
        question = self._questions.get(request.path_params['name'])
        if question is None:
            return PlainTextResponse('no such question', 404)
        return await _answered(question, dict(request.query_params))

    async def _get(self, request: Request) -> Response:
        name = request.path_params['name']
        make = self._documents.get(name)
        if make is None:
            expected = nearest(name[:80], self._documents)
            return PlainTextResponse(f'no document {name[:80]!r}, expected {expected}', 404)
        fields: dict[str, Any] = dict(request.query_params)
        fields.pop('token', None)
        if 'leaves' in inspect.signature(make).parameters:
            fields['leaves'] = not self._gate.is_local
        try:
            inspect.signature(make).bind(**fields)
            made = await run_in_threadpool(make, **fields)
        except (ValueError, TypeError, CallError, OSError) as error:
            said = in_one_line(error) if isinstance(error, OSError) else str(error)
            return PlainTextResponse(said, 422)
        headers = {}
        if made.name:
            headers['Content-Disposition'] = f'attachment; filename="{made.name}"'
        if made.kind.startswith('text/html'):
            # What it says was made by programs; its style is its own.
            headers['Content-Security-Policy'] = DOCUMENT_POLICY
        return Response(made.content, media_type=made.kind, headers=headers)

    async def _metrics(self, request: Request) -> Response:
        make = self._documents.get('metrics')
        if make is None:
            return PlainTextResponse('no metrics here', 404)
        made = await run_in_threadpool(make)
        return Response(made.content, media_type=made.kind)

    async def _openapi(self, request: Request) -> Response:
        return JSONResponse(description(self._questions, self._actions, self._documents))

    async def _act(self, request: Request) -> Response:
        name = request.path_params['name']
        if not self._actions:
            return JSONResponse(
                {'ok': False, 'text': 'control is off: start with --web-control'}, 403
            )
        action = self._actions.get(name)
        if action is None:
            expected = nearest(name[:80], self._actions)
            return JSONResponse(
                {'ok': False, 'text': f'no action {name[:80]!r}, expected {expected}'}, 404
            )
        if problem := self._gate.foreign(request):
            return JSONResponse({'ok': False, 'text': problem}, 403)
        person = HOLDER if self._replay else self._gate.person(request)
        if person is None:
            text = 'refused: open the address with the token that the mission printed'
            return JSONResponse({'ok': False, 'text': text}, 403)
        body = bytearray()
        longest = self._longest.get(name, LONGEST_BODY)
        async for chunk in request.stream():
            body += chunk
            if len(body) > longest:
                # What still comes is not read: the connection ends.
                return JSONResponse(
                    {'ok': False, 'text': 'the request is too long'}, 413, {'Connection': 'close'}
                )
        try:
            given = parse_json(bytes(body) or b'{}')
        except ValueError:
            given = None
        if not isinstance(given, dict):
            return JSONResponse({'ok': False, 'text': 'expected a JSON object'}, 400)
        if not person.may(wanted := least_role(name, given)):
            text = f'refused: {person.name} is a {person.role}, this takes a {wanted}'
            return JSONResponse({'ok': False, 'text': text}, 403)
        if 'by' in inspect.signature(action).parameters:
            given['by'] = person.name
        answer = await _answered(action, given, self._stop_threads if name in STOPPING else None)
        if not self._replay and name not in UNTOLD:
            said = parse_json(bytes(answer.body)).get('text', '')
            # The robot stops though the disk is full and waits.
            asyncio.get_running_loop().run_in_executor(
                None, self._pressed, person, name, given, str(said)
            )
        return answer


class _Guard:
    """Refuses who may not look, and gives every answer its headers."""

    def __init__(
        self,
        app: ASGIApp,
        refusal: Callable[[Request], tuple[int, str] | None],
        report: Callable[[str], Any],
    ) -> None:
        self._app = app
        self._refusal = refusal
        self._report = report

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope['type'] != 'http':
            return
        begun = False

        async def send_with_headers(message: Any) -> None:
            nonlocal begun
            begun = True
            if message['type'] == 'http.response.start':
                extra = [(k.lower().encode(), v.encode()) for k, v in HEADERS.items()]
                known = {key.lower() for key, _ in message.get('headers', [])}
                extra = [each for each in extra if each[0] not in known]
                message['headers'] = [*message.get('headers', []), *extra]
            await send(message)

        try:
            request = Request(scope)
            refused = self._refusal(request)
            if refused is None and 'upgrade' in request.headers:
                refused = 426, 'no WebSocket here: what changes is told at /events'
            app = self._app if refused is None else PlainTextResponse(refused[1], refused[0])
            await app(scope, receive, send_with_headers)
        except Exception as error:  # one request costs one line, whatever it was
            self._report(f'a request for {scope["path"][:80]!r} failed: {error!r:.200}')
            if not begun:
                await PlainTextResponse('failed', 500)(scope, receive, send_with_headers)


async def _answered(
    call: Action, fields: Mapping[str, Any], threads: Executor | None = None
) -> Response:
    try:
        inspect.signature(call).bind(**fields)
        if threads is None:
            result = await run_in_threadpool(call, **fields)
        else:
            loop = asyncio.get_running_loop()
            result = await loop.run_in_executor(threads, partial(call, **fields))
    except (ValueError, TypeError, CallError) as error:
        return JSONResponse({'ok': False, 'text': str(error)}, 422)
    return JSONResponse({'ok': True, 'text': result} if isinstance(result, str) else result)


def _is_urgent(begun: bytes) -> bool:
    """Tell by the first bytes of a request whether it stops a robot."""
    return begun.startswith(tuple(f'POST /act/{each}'.encode() for each in STOPPING))


class _Loop:
    """An event loop that serves connections which somebody else accepts.

    Args:
        app: What is served.
        most: How many connections there may be.
        crowded: See `Page`.
    """

    def __init__(self, app: Any, most: int, crowded: Callable[[bool], object]) -> None:
        bounds = {'most': most, 'crowded': staticmethod(crowded)}
        self._connection: Any = type('Connection', (BoundedConnection,), bounds)
        self._config = uvicorn.Config(
            app,
            http=self._connection,
            ws='none',
            log_config=None,
            access_log=False,
            lifespan='off',
            timeout_graceful_shutdown=1,
            server_header=False,
        )
        self.server = uvicorn.Server(self._config)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._runs = threading.Event()
        self._tasks: set[asyncio.Task[None]] = set()

    def run(self) -> None:
        """Serve until the server is told to exit."""
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        if not self._config.loaded:
            self._config.load()
        self._runs.set()
        await self.server.serve(sockets=[])

    def take(self, peer: socket.socket) -> None:
        """Serve a connection; from any thread."""
        self._runs.wait()
        assert self._loop is not None
        try:
            self._loop.call_soon_threadsafe(self._begin, peer)
        except RuntimeError:  # the loop has ended
            peer.close()

    def _begin(self, peer: socket.socket) -> None:
        task = asyncio.ensure_future(self._connect(peer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _connect(self, peer: socket.socket) -> None:
        loop, kind = asyncio.get_running_loop(), self._connection
        given = {'config': self._config, 'server_state': self.server.server_state, 'app_state': {}}
        try:
            await loop.connect_accepted_socket(partial(kind, **given), peer)
        except OSError:
            peer.close()


class _OneLine(logging.Handler):
    """Passes on what uvicorn has to say, a line each and without tracebacks."""

    def __init__(self, report: Callable[[str], Any]) -> None:
        super().__init__(logging.WARNING)
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        cause = f': {error!r:.200}' if error else ''
        self._report(record.getMessage().split('\n')[0][:200] + cause)


def _report_for_uvicorn(report: Callable[[str], Any]) -> None:
    logger = logging.getLogger('uvicorn.error')
    logger.handlers[:] = [_OneLine(report)]
    logger.propagate = False


def _bound(host: str, port: int) -> socket.socket:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        bound = socket.socket(family, kind, protocol)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        bound.bind(address)
        bound.listen(64)
    except (OSError, OverflowError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise OSError(f'the page cannot be served at {host}:{port}: {reason}') from None
    return bound
