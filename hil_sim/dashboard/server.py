"""The page and its data over HTTP on loopback, and a bus as a websocket.

A page of another origin gets nothing: names of hosts other than loopback are refused, and so is a
websocket that another origin opens. What a browser sends over the websocket is not read.
"""

from __future__ import annotations

import asyncio
import json
import socket
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from bms.errors import InputError, ModelMismatchError
from bms.model.pair import load_pair
from hil_sim.dashboard.build import STATIC
from hil_sim.dashboard.feed import BusFeed
from hil_sim.dashboard.pack_scenario import packs_data
from hil_sim.dashboard.page_data import (
    config_data,
    database_data,
    preset_data,
    rows_data,
    tightened_data,
)

Maker = Callable[[], object]
"""Makes what becomes JSON."""

HOST = "127.0.0.1"
_HOSTS = (HOST, "localhost")
_REFRESH_S = 0.2
_GRACE_S = 2
_MOST_HEARD = 1024  # bytes of a message of a browser, which has nothing to say
_POLICY_VIOLATION, _GOING_AWAY = 1008, 1001
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; "
    "style-src 'self'; img-src 'self' data:; connect-src 'self'; worker-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}


def make_app(
    preset: str, model: Path | None = None, bus: str | None = None, feed: BusFeed | None = None
) -> Starlette:
    """The application: page, data, and the feed of a bus.

    The preset is a name or a path, and the first that the page shows. Raises InputError or
    ModelMismatchError as load_pair.
    """
    chosen, _ = load_pair(preset, model)
    config = config_data(bus, chosen.name)
    makers: dict[str, Maker] = {"config": lambda: config, "database": database_data}
    places: dict[str, tuple[str, Path | None]] = {}
    for name in config["presets"]:
        place, of_it = places[name] = (preset, model) if name == chosen.name else (name, None)
        makers[name] = partial(preset_data, place, of_it)
        makers[f"{name}.rows"] = partial(rows_data, place)
    makers[f"{config['packs']}.packs"] = partial(packs_data, config["packs"])
    data = _Data(makers)
    threading.Thread(target=data.prepare, args=(chosen.name,), daemon=True).start()

    async def limits(request: Request) -> Response:
        return await _limits(request, places)

    async def websocket(socket: WebSocket) -> None:
        await _feed(socket, feed)

    return Starlette(
        routes=[
            Route("/data/{name}.json", data.answer),
            Route("/limits/{name}.json", limits),
            WebSocketRoute("/feed", websocket),
            Mount("/", StaticFiles(directory=STATIC, html=True)),
        ],
        middleware=[
            Middleware(TrustedHostMiddleware, allowed_hosts=list(_HOSTS)),
            Middleware(_SafeHeaders),
        ],
    )


class _Data:
    """JSON by name, made when it is asked for first."""

    def __init__(self, makers: Mapping[str, Maker]) -> None:
        self._makers = makers
        self._made: dict[str, str] = {}
        self._lock = threading.Lock()

    def prepare(self, name: str) -> None:
        """Make what a page asks for first, before it does."""
        for wanted in ("database", name, f"{name}.rows"):
            self._make(wanted)

    async def answer(self, request: Request) -> Response:
        """The JSON, or 404."""
        name: str = request.path_params["name"]
        if name not in self._makers:
            raise HTTPException(404)
        content = await run_in_threadpool(self._make, name)
        return Response(content, media_type="application/json")

    def _make(self, name: str) -> str:
        with self._lock:
            if name not in self._made:
                self._made[name] = json.dumps(self._makers[name]())
            return self._made[name]


class _SafeHeaders:
    """Adds what keeps a browser from fetching, or being fetched from, elsewhere."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, with the headers in an answer."""

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                extra = [(k.lower().encode(), v.encode()) for k, v in _HEADERS.items()]
                message["headers"] = [*message["headers"], *extra]
            await send(message)

        await self._app(scope, receive, sending)


def is_own_origin(origin: str | None, host: str | None) -> bool:
    """Whether a websocket is opened by the page of this server. A browser always tells its origin;
    what tells none is no browser."""
    return origin is None or urlsplit(origin).netloc == host


async def _limits(request: Request, places: Mapping[str, tuple[str, Path | None]]) -> Response:
    """A preset with the limits of the query, or why not."""
    name: str = request.path_params["name"]
    if name not in places:
        raise HTTPException(404)
    try:
        made = await run_in_threadpool(tightened_data, *places[name], request.query_params)
    except (InputError, ModelMismatchError) as error:
        return JSONResponse({"error": str(error)})
    return JSONResponse(made)


async def _feed(socket: WebSocket, feed: BusFeed | None) -> None:
    if feed is None or not is_own_origin(socket.headers.get("origin"), socket.headers.get("host")):
        await socket.close(_POLICY_VIOLATION)  # before it is accepted: refused with 403
        return
    await socket.accept()
    gone = asyncio.create_task(_wait_until_gone(socket))
    with suppress(WebSocketDisconnect, RuntimeError):
        while not gone.done():
            message = await run_in_threadpool(feed.message)
            await socket.send_text(json.dumps(message))
            if "error" in message:
                await socket.close(_GOING_AWAY)
                break
            await asyncio.wait([gone], timeout=_REFRESH_S)
    gone.cancel()


async def _wait_until_gone(socket: WebSocket) -> None:
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass


class Server:
    """Serves an application on a port of loopback in a thread, from its making until `close`."""

    def __init__(self, app: Starlette, port: int) -> None:
        """Port 0 is any free one. Raises InputError for a port that cannot be had."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((HOST, port))
            self._socket.listen()  # so that a browser may come at once
        except OSError as error:
            self._socket.close()
            raise InputError(f"--port {port}: {error.strerror}; give another one") from None
        self.port: int = self._socket.getsockname()[1]
        self._server = uvicorn.Server(
            uvicorn.Config(
                app,
                log_level="critical",
                lifespan="off",
                ws_max_size=_MOST_HEARD,
                timeout_graceful_shutdown=_GRACE_S,
            )
        )
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [self._socket]}, daemon=True
        )
        self._thread.start()

    @property
    def address(self) -> str:
        """Where a browser finds the page."""
        return f"http://{HOST}:{self.port}/"

    def close(self) -> None:
        """End all connections and the thread."""
        self._server.should_exit = True
        self._thread.join()
        self._socket.close()
