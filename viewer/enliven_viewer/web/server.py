"""The web server: serves the files of the page, the QR code for phones, and a WebSocket for each page."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

import segno
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from enliven.web_page.page_files import PAGE_FILES, read_page_file
from enliven.web_server.certificate import load_certificate
from enliven.web_server.listening import bind_port, make_server
from enliven_viewer.web.access import WebAccess
from enliven_viewer.web.bridge import Bridge

if TYPE_CHECKING:
    from enliven_viewer.web.page_queue import PageQueue

MAX_PAGES = 64
"""Maximum number of connected pages. The bridge copies each message for every page."""
MAX_CONNECTIONS = 200
"""Maximum number of connections. In addition to its WebSocket, a browser opens several for the files of a
page.
"""
_MAX_ANSWER_BYTES = 64
"""Maximum size in bytes of a message from a page. It contains only the number of a batch."""
_DENIED = 4401
"""WebSocket close code of a connection with a wrong token. It is from the private range 4000 to 4999, and
resembles HTTP's 401.
"""
_FULL = 1013
"""WebSocket close code "try again later" (IANA's registry) of a connection that exceeds the
limit of pages.
"""
_INVALID = 1003
"""WebSocket close code "unexpected data" (RFC 6455) of a connection that sent an invalid message."""
_HEADERS = {
    # The page loads nothing from other servers, and no other site can show it in a frame.
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


class WebServer:
    """Serves the page of one edge until the program is interrupted.

    Args:
        edge: address of the edge.
        access: the address to listen on, and the rules for requests.
        port: port of the page; 0 for any free port.

    Attributes:
        port: the port in use.

    Raises:
        ResourceError: if the port is in use, or the address does not belong to this machine.
        InputError: if the certificate cannot be used.
    """

    def __init__(self, edge: str, access: WebAccess, port: int = 0) -> None:
        self._edge, self._access = edge, access
        self._socket = bind_port(access.host, port, "Choose another --port.")
        self.port: int = self._socket.getsockname()[1]
        self._bridge: Bridge | None = None
        routes = [
            Route("/", self._send_file),
            Route("/share.json", self._send_share),
            Route("/{name}", self._send_file),
            WebSocketRoute("/live", self._serve_page),
        ]
        app = Starlette(routes=routes, lifespan=self._run_bridge)
        certificate = None
        if access.certificate is not None and access.key is not None:
            certificate = load_certificate(access.certificate, access.key, time.time())
        self._server = make_server(
            app, certificate, max_connections=MAX_CONNECTIONS, max_message_bytes=_MAX_ANSWER_BYTES
        )

    @property
    def link(self) -> str:
        """Returns the complete address of the page, with its token."""
        return self._access.link(self.port)

    def run(self) -> None:
        """Serves until SIGINT or SIGTERM, or until :meth:`stop`."""
        self._server.run(sockets=[self._socket])
        if self._bridge is not None and self._bridge.failure is not None:
            raise self._bridge.failure

    def stop(self) -> None:
        """Ends :meth:`run`. Thread-safe."""
        self._server.should_exit = True

    @contextlib.asynccontextmanager
    async def _run_bridge(self, app: Starlette) -> AsyncIterator[None]:
        # The constructor compiles the pose decoder, which takes seconds the first time on a machine.
        self._bridge = await asyncio.to_thread(Bridge, self._edge, asyncio.get_running_loop(), self.stop)
        try:
            yield
        finally:
            await asyncio.to_thread(self._bridge.close)

    async def _send_file(self, request: Request) -> Response:
        name = request.path_params.get("name", "page.html")
        if name not in PAGE_FILES:
            return Response("This page does not exist.", 404, _HEADERS)
        return Response(read_page_file(name), 200, _HEADERS, PAGE_FILES[name])

    async def _send_share(self, request: Request) -> Response:
        """Sends the address for other machines and its QR code. The address is empty if other machines cannot
        open the page.
        """
        if not self._admits(request):
            return Response("The token in the address is wrong.", 403, _HEADERS)
        if self._access.is_local:
            return JSONResponse({"address": "", "qr": ""}, headers=_HEADERS)
        code = segno.make(self.link, micro=False).svg_data_uri(scale=8, border=2)
        return JSONResponse({"address": self._access.address(self.port), "qr": code}, headers=_HEADERS)

    def _admits(self, connection: Request | WebSocket) -> bool:
        headers = connection.headers
        token = connection.query_params.get("token", "")
        return self._access.admits(token, headers.get("host", ""), headers.get("origin", ""))

    async def _serve_page(self, page: WebSocket) -> None:
        """Sends the stream to one page until it leaves."""
        await page.accept()
        bridge = self._bridge
        if not self._admits(page):
            # Accept the connection first, because browsers do not report the reason for a refused connection.
            await page.close(_DENIED)
        elif bridge is None or bridge.page_count >= MAX_PAGES:
            await page.close(_FULL)
        else:
            with bridge.join() as queue:
                sending = asyncio.create_task(_send(page, queue))
                try:
                    await _receive(page, queue)
                finally:
                    sending.cancel()
                    with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                        await sending


async def _send(page: WebSocket, queue: PageQueue) -> None:
    """Sends messages as fast as the page draws them."""
    while True:
        data = await queue.next()
        if isinstance(data, str):
            await page.send_text(data)
        else:
            await page.send_bytes(data)


async def _receive(page: WebSocket, queue: PageQueue) -> None:
    """Handles the page's answers until it leaves. Any other message ends the connection."""
    with contextlib.suppress(WebSocketDisconnect):
        while True:
            message = await page.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text") or ""
            if not (text.isascii() and text.isdecimal()):
                await page.close(_INVALID)
                return
            queue.answer(int(text))
