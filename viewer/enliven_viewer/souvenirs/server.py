"""The server of souvenirs: sends a photo or film to a phone that knows its token, and nothing else. It lists
nothing and changes nothing. It needs no password, because a token cannot be guessed. It is a separate
process, so that many requests cannot slow the show down.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import re
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route

from enliven.errors import EnlivenError, InputError
from enliven.kiosk.profile import KioskProfile
from enliven.kiosk.souvenir_address import check_souvenir_address
from enliven.supervision.notify import Notifier
from enliven.supervision.records import ServiceRecord, write_service
from enliven.web_server.certificate import load_certificate
from enliven.web_server.listening import bind_port, make_server
from enliven_viewer.language import tr
from enliven_viewer.souvenirs.store import SouvenirStore, make_store

log = logging.getLogger(__name__)

SERVICE = "souvenirs"
"""Name of this program in the supervisor's list of services."""
_SWEEP_INTERVAL_S = 1.0
"""Seconds between two deletions of expired souvenirs."""
_RECORD_INTERVAL_S = 10.0
"""Seconds between two writes of this program's state record."""
_MEDIA_TYPES = {".jpg": "image/jpeg", ".mp4": "video/mp4"}
_HEADERS = {
    # The page loads only the photo or film, and no other site can show it in a frame.
    "Content-Security-Policy": "default-src 'none'; img-src 'self'; media-src 'self'; "
    "style-src 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Robots-Tag": "noindex, nofollow",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "private, no-store",
}
_NOT_A_LETTER = re.compile(r"[^A-Za-z0-9_-]+")
"""Matches the characters that are removed from the suggested file name."""


class SouvenirApplication:
    """The routes of the server, and the loop that deletes souvenirs.

    Args:
        store: the souvenirs.
        name: the name of the kiosk, used in the suggested file name.
        notifier: reports progress to the supervisor.
        should_stop: returns True if the server must stop, for example because its parent has ended.
        stop: ends the server.
    """

    def __init__(
        self,
        store: SouvenirStore,
        name: str,
        notifier: Notifier | None = None,
        should_stop: Callable[[], bool] = lambda: False,
        stop: Callable[[], None] = lambda: None,
    ) -> None:
        self._store, self._file_name = store, _NOT_A_LETTER.sub("-", name).strip("-") or "souvenir"
        self._notifier = notifier or Notifier("")
        self._should_stop, self._stop = should_stop, stop
        self._started_s, self._recorded_s = time.time(), -_RECORD_INTERVAL_S

    def asgi(self) -> Starlette:
        """Returns the ASGI application."""
        return Starlette(routes=[Route("/{token}", self._send)], lifespan=self._lifespan)

    async def _send(self, request: Request) -> Response:
        path = await asyncio.to_thread(self._store.find, request.path_params["token"])
        state = None
        if path is not None:
            # The file may be deleted at this moment.
            with contextlib.suppress(OSError):
                state = path.stat()
        if path is None or state is None:
            return PlainTextResponse(tr("This souvenir does not exist any more.") + "\n", 404, _HEADERS)
        return FileResponse(
            path,
            headers=_HEADERS,
            media_type=_MEDIA_TYPES[path.suffix],
            filename=f"{self._file_name}{path.suffix}",
            stat_result=state,
            content_disposition_type="inline",
        )

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Any) -> AsyncIterator[None]:
        """Deletes souvenirs while the server runs."""
        task = asyncio.create_task(self._sweep_forever())
        try:
            yield
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task

    async def _sweep_forever(self) -> None:
        """Deletes expired souvenirs, and reports progress."""
        while not self._should_stop():
            count = await asyncio.to_thread(self._store.delete_expired)
            status = f"souvenirs kept: {count}"
            self._notifier.report_progress(status)
            await asyncio.to_thread(self._write_record, status)
            await asyncio.sleep(_SWEEP_INTERVAL_S)
        self._stop()

    def _write_record(self, status: str) -> None:
        """Writes this program's state record if ``_RECORD_INTERVAL_S`` has passed."""
        now = time.monotonic()
        if now - self._recorded_s < _RECORD_INTERVAL_S:
            return
        self._recorded_s = now
        try:
            write_service(ServiceRecord(SERVICE, os.getpid(), self._started_s, time.time(), status))
        except (EnlivenError, OSError) as error:
            log.warning("the status file of the souvenir server cannot be written: %s", error)


def serve_souvenirs(
    profile: KioskProfile, where: str, should_stop: Callable[[], bool] = lambda: False
) -> None:
    """Serves the souvenirs of a kiosk until SIGTERM or Ctrl-C.

    Args:
        profile: the kiosk's profile. Its paths are relative to the current folder.
        where: path of the profile's file, for messages.
        should_stop: returns True if the server must stop, for example because its parent has ended.

    Raises:
        InputError: if the profile makes no souvenirs, no phone can open their address, or the certificate
            cannot be used.
        ResourceError: if the port is in use.
    """
    settings = profile.souvenir
    if not settings.kind:
        remedy = 'Set souvenir.kind to "photo" or "film" in the profile (docs/kiosk.md).'
        raise InputError("this kiosk does not make souvenirs", where=where, remedy=remedy)
    check_souvenir_address(settings, where)
    certificate = None
    if settings.certificate:
        certificate = load_certificate(
            Path(settings.certificate), Path(settings.certificate_key), time.time()
        )
    notifier = Notifier()

    def stop() -> None:
        server.should_exit = True

    with bind_port(settings.host, settings.port, "Choose another souvenir.port.") as listener:
        application = SouvenirApplication(make_store(profile), profile.name, notifier, should_stop, stop)
        server = make_server(application.asgi(), certificate)
        protocol = "without encryption" if certificate is None else "with TLS"
        log.info("souvenirs are served %s at %s, port %s", protocol, settings.host, settings.port)
        notifier.report_ready(f"at port {settings.port}")
        try:
            server.run(sockets=[listener])
        finally:
            notifier.report_stopping()
            notifier.close()
