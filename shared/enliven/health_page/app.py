"""The web application of the health page, based on Starlette: routes, access control, and actions."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import os
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import msgspec
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import MutableHeaders
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from enliven.errors import EnlivenError, InputError
from enliven.files import read_file
from enliven.health import Severity
from enliven.health_page.alert_delivery import AlertSender
from enliven.health_page.alerts import AlertRules
from enliven.health_page.collector import HealthCollector
from enliven.health_page.log_tail import LogTail
from enliven.health_page.machine import terminate_program
from enliven.health_page.metrics import HealthCounters, metrics_text
from enliven.health_page.page import PageWriter
from enliven.health_page.report import REPORT_PATH, make_report
from enliven.health_page.snapshot import Problem, ProblemKind
from enliven.logs import escape_text
from enliven.supervision.notify import Notifier
from enliven.supervision.records import SCREEN_PICTURE_FILE, ServiceRecord, runtime_folder, write_service
from enliven.web_server.access import FormTokens, PasswordGate, is_same_origin, names_this_computer
from enliven.wire import LearnRoom, send_order, show_pairing_code

log = logging.getLogger(__name__)

SERVICE_NAME = "health"
"""Name of this program in the service record that it writes."""
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; style-src 'self'; script-src 'self'; img-src 'self'; "
    "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Headers of every response. They forbid content from other servers."""
_STRICT_TRANSPORT = "max-age=31536000"
"""Strict-Transport-Security header of responses over TLS. Browsers then use TLS for a year, even if a user
enters an address without https."""
_MAX_FORM_BYTES = 4096
"""Maximum size of a submitted form in bytes. The forms of the page have about 300 bytes."""
_MAX_PICTURE_BYTES = 32 << 20
"""Maximum size in bytes of the picture of the screen."""
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
"""First bytes of a PNG file."""
_NOTICE_DISPLAY_S = 60.0
"""Time in seconds for which the page shows a notice about an action."""
_MAX_NOTICES = 5
"""Maximum number of notices that are shown."""
_MIN_ACTION_INTERVAL_S = 3.0
"""Minimum time between two actions, in seconds. A double click must not restart a program twice."""
_RELOAD_ADVICE = "Load the page again."
"""The remedy for an invalid form."""
_RECORD_INTERVAL_S = 10.0
"""Interval in seconds at which this program writes its service record."""


class GuardMiddleware:
    """ASGI middleware that refuses requests without the password, and adds headers to every response.

    Args:
        gate: checks passwords. None means that no password is required.
        uses_tls: True if the connection is encrypted.
        checks_host: True to answer only requests to a name of this computer's loopback.
    """

    def __init__(self, app: ASGIApp, gate: PasswordGate | None, uses_tls: bool, checks_host: bool) -> None:
        self._app, self._gate, self._checks_host = app, gate, checks_host
        self._headers = dict(_HEADERS)
        if uses_tls:
            self._headers["Strict-Transport-Security"] = _STRICT_TRANSPORT

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(self._headers)
            await send(message)

        refusal = self._check_request(Request(scope))
        await (refusal or self._app)(scope, receive, send_with_headers)

    def _check_request(self, request: Request) -> Response | None:
        """Returns the response to a request with a wrong host or password. Returns None if the request is
        accepted."""
        if self._checks_host and not names_this_computer(request.headers.get("host", "")):
            return PlainTextResponse("Open this page by the address http://127.0.0.1.\n", 400)
        if self._gate is None:
            return None
        address = request.client.host if request.client else ""
        wait_s = self._gate.compute_remaining_lockout_s(address)
        if wait_s > 0.0:
            headers = {"Retry-After": str(round(wait_s) + 1)}
            text = f"Too many wrong passwords. Try again in {wait_s:.0f} s.\n"
            return PlainTextResponse(text, 429, headers)
        if self._gate.admits(address, request.headers.get("authorization", "")):
            return None
        if self._gate.compute_remaining_lockout_s(address) > 0.0:
            log.warning("%s sent too many wrong passwords and is blocked for some time.", address)
        headers = {"WWW-Authenticate": 'Basic realm="enliven health", charset="UTF-8"'}
        return PlainTextResponse(
            "The password is missing or wrong. The user name does not matter.\n", 401, headers
        )


class HealthApplication:
    """The web application: the routes of the health page, and the loop that refreshes its state.

    Args:
        collector: collects the state.
        alert_rules: decides which alerts are sent.
        alert_senders: the threads that deliver the alerts.
        notifier: reports progress to the supervisor.
        should_stop: a function that returns True if the program must end, for example because its parent has
            ended.
        stop: a function that ends the server.
    """

    def __init__(
        self,
        collector: HealthCollector,
        alert_rules: AlertRules,
        alert_senders: Sequence[AlertSender] = (),
        notifier: Notifier | None = None,
        should_stop: Callable[[], bool] = lambda: False,
        stop: Callable[[], None] = lambda: None,
    ) -> None:
        self._collector, self._alert_rules, self._alert_senders = collector, alert_rules, alert_senders
        self._notifier = notifier or Notifier("")
        self._should_stop, self._stop = should_stop, stop
        self._writer, self._tokens, self._log = PageWriter(), FormTokens(), LogTail()
        self._notices: deque[tuple[float, str]] = deque(maxlen=_MAX_NOTICES)
        self._acted_s = -_MIN_ACTION_INTERVAL_S
        self._started_s, self._recorded_s = time.time(), -_RECORD_INTERVAL_S
        # Use a single thread, because only one thread at a time may use a ZeroMQ socket.
        self._executor = ThreadPoolExecutor(1, "health")

    def create_asgi_app(
        self, gate: PasswordGate | None = None, uses_tls: bool = False, checks_host: bool = True
    ) -> Starlette:
        """Returns the application for a server.

        Args:
            gate: checks passwords. None means that no password is required.
            uses_tls: True if the server encrypts.
            checks_host: True to answer only requests with a loopback address as their Host header.
        """
        static = Path(__file__).parent / "static"
        middleware = [Middleware(GuardMiddleware, gate=gate, uses_tls=uses_tls, checks_host=checks_host)]
        routes = [
            Route("/", self._serve_page),
            Route(REPORT_PATH, self._serve_report),
            Route("/metrics", self._serve_metrics),
            Route("/screen.png", self._serve_picture),
            Route("/confirm", self._serve_confirmation),
            Route("/restart", self._restart_program, methods=["POST"]),
            Route("/code", self._serve_pairing_code, methods=["POST"]),
            Route("/room", self._relearn_room, methods=["POST"]),
            Mount("/static", StaticFiles(directory=static)),
        ]
        return Starlette(routes=routes, middleware=middleware, lifespan=self._lifespan)

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Any) -> AsyncIterator[None]:
        """Refreshes the state while the server runs."""
        task = asyncio.create_task(self._refresh_forever())
        try:
            yield
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
            # Wait for the last refresh, which may still use the sockets.
            await asyncio.get_running_loop().run_in_executor(self._executor, self._collector.close)
            self._executor.shutdown()

    async def _refresh_forever(self) -> None:
        """Refreshes the state, sends alerts, and reports progress to the supervisor, in a loop. A failed
        refresh is not reported as progress."""
        loop, has_warned = asyncio.get_running_loop(), False
        while not self._should_stop():
            try:
                has_read = await loop.run_in_executor(
                    self._executor, functools.partial(self._collector.refresh, self._alert_faults())
                )
                self._send_alerts()
                if has_read:
                    self._notifier.report_progress(self._collector.snapshot.status)
                    await loop.run_in_executor(self._executor, self._write_own_record)
            except Exception:
                if not has_warned:
                    log.exception("The health page could not refresh its data.")
                has_warned = True
                await asyncio.sleep(1.0)
        self._stop()

    def _send_alerts(self) -> None:
        """Passes new alerts to the threads that deliver them."""
        snapshot = self._collector.snapshot
        for alert in self._alert_rules.update(snapshot.problems, time.monotonic(), snapshot.at_s):
            log.info("alert (%s) about %s: %s", alert.event, alert.subject or "this computer", alert.message)
            for courier in self._alert_senders:
                courier.enqueue_alert(alert)

    def _alert_faults(self) -> list[Problem]:
        """Returns a problem for each target to which the newest alert was not delivered."""
        return [
            Problem(
                ProblemKind.ALERTS_FAIL,
                "",
                Severity.WARNING,
                f"Alerts are not delivered: {escape_text(courier.fault)}.",
                "Check [alerts] in the profile. To send a test alert, type: enliven health PROFILE "
                "--test-alert",
            )
            for courier in self._alert_senders
            if courier.fault
        ]

    def _write_own_record(self) -> None:
        """Writes this program's service record if the interval has passed."""
        time_now = time.monotonic()
        if time_now - self._recorded_s < _RECORD_INTERVAL_S:
            return
        self._recorded_s = time_now
        record = ServiceRecord(
            SERVICE_NAME,
            os.getpid(),
            self._started_s,
            time.time(),
            f"reports: {self._collector.snapshot.status}",
        )
        try:
            write_service(record)
        except (EnlivenError, OSError) as error:
            log.warning("The status record of the health page cannot be written: %s", error)

    async def _serve_page(self, request: Request) -> Response:
        return HTMLResponse(await run_in_threadpool(self._write_page))

    def _write_page(self) -> str:
        time_now = time.monotonic()
        notices = [text for at_s, text in self._notices if time_now - at_s < _NOTICE_DISPLAY_S]
        picture_at_s = None
        with contextlib.suppress(OSError, EnlivenError):
            picture_at_s = (runtime_folder() / SCREEN_PICTURE_FILE).stat().st_mtime
        return self._writer.render_health_page(
            self._collector.snapshot, self._collector.history, self._log.read(), notices, picture_at_s
        )

    async def _serve_report(self, request: Request) -> Response:
        snapshot = self._collector.snapshot
        status = 503 if snapshot.severity is Severity.ERROR else 200
        return Response(msgspec.json.encode(make_report(snapshot)), status, media_type="application/json")

    async def _serve_metrics(self, request: Request) -> Response:
        counts = HealthCounters(
            dict(self._collector.restart_counts),
            sum(courier.sent for courier in self._alert_senders),
            sum(courier.failures for courier in self._alert_senders),
        )
        data, media_type = await run_in_threadpool(metrics_text, self._collector.snapshot, counts)
        return Response(data, headers={"Content-Type": media_type})

    async def _serve_picture(self, request: Request) -> Response:
        try:
            data = await run_in_threadpool(_read_picture)
        except (EnlivenError, OSError):
            data = b""
        if not data.startswith(_PNG_SIGNATURE):
            return PlainTextResponse(
                "No kiosk window has stored a picture of its screen on this computer.\n", 404
            )
        return Response(data, media_type="image/png")

    async def _serve_confirmation(self, request: Request) -> Response:
        """Returns the page that asks for confirmation of an action. It is used if JavaScript is disabled."""
        action, subject = request.query_params.get("action", ""), request.query_params.get("subject", "")
        if action == "restart" and subject in self._read_program_pids():
            question = (
                f"{subject} ends, and its supervisor restarts it within seconds. If the program is an "
                "edge, it learns the room again. Visitors see an interruption."
            )
            texts = (f"Restart {subject}?", question, "Restart", "/restart")
        elif action == "code" and subject in self._collector.endpoints:
            question = f"With this code, a new viewer can be paired with {subject} for some minutes."
            texts = ("Show the pairing code?", question, "Show the code", "/code")
        elif action == "room" and subject in self._collector.endpoints:
            question = (
                f"{subject} forgets the background and the floor, and learns both again within "
                "seconds. Do this if furniture was moved and the view of the camera is empty."
            )
            texts = ("Learn the room again?", question, "Learn the room", "/room")
        else:
            error = InputError("the requested program or edge does not exist", remedy=_RELOAD_ADVICE)
            return self._create_failure_page(error, 404)
        token = self._tokens.make(action, subject)
        return HTMLResponse(self._writer.render_confirmation(*texts, subject, token))

    async def _restart_program(self, request: Request) -> Response:
        """Ends a program, so that its supervisor starts it again."""
        try:
            subject = await self._read_action(request, "restart")
            pid = self._read_program_pids().get(subject)
            if pid is None:
                raise InputError(f"the program {subject} does not exist", remedy=_RELOAD_ADVICE)
            await run_in_threadpool(terminate_program, subject, pid)
        except EnlivenError as error:
            return self._create_failure_page(error)
        address = request.client.host if request.client else "unknown"
        log.warning("%s restarted the program %s", address, subject)
        notice = f"{address} restarted the program {subject}."
        self._notices.append((time.monotonic(), escape_text(notice)))
        return Response(status_code=303, headers={"Location": "/"})

    async def _serve_pairing_code(self, request: Request) -> Response:
        """Shows the pairing code of an edge. This program needs the role *operate* on the edge."""
        try:
            subject = await self._read_action(request, "code")
            endpoint = self._collector.endpoints.get(subject)
            if endpoint is None:
                raise InputError(f"the edge {subject} does not exist", remedy=_RELOAD_ADVICE)
            code, seconds = await run_in_threadpool(show_pairing_code, endpoint)
        except EnlivenError as error:
            return self._create_failure_page(error)
        log.warning(
            "%s requested the pairing code of %s",
            request.client.host if request.client else "unknown",
            subject,
        )
        if not code:
            text = f"Too many wrong codes were entered. The edge shows a new code in {seconds} s."
            return HTMLResponse(self._writer.render_result(f"Pairing code of {subject}", text))
        text = (
            f"The code expires in {seconds} s. On the viewer's computer, type: enliven pair "
            f"{endpoint.host} {code}"
        )
        return HTMLResponse(
            self._writer.render_result(f"Pairing code of {subject}", text, code=escape_text(code))
        )

    async def _relearn_room(self, request: Request) -> Response:
        """Makes an edge learn the room again. This program needs the role *operate* on the edge."""
        try:
            subject = await self._read_action(request, "room")
            endpoint = self._collector.endpoints.get(subject)
            if endpoint is None:
                raise InputError(f"the edge {subject} does not exist", remedy=_RELOAD_ADVICE)
            await run_in_threadpool(send_order, endpoint, LearnRoom())
        except EnlivenError as error:
            return self._create_failure_page(error)
        address = request.client.host if request.client else "unknown"
        log.warning("%s made %s learn the room again", address, subject)
        notice = f"{address} made {subject} learn the room again."
        self._notices.append((time.monotonic(), escape_text(notice)))
        return Response(status_code=303, headers={"Location": "/"})

    async def _read_action(self, request: Request, action: str) -> str:
        """Checks a submitted form, and returns the edge or program that it refers to.

        Raises:
            InputError: if the form is not from this page, or follows another action too soon.
        """
        headers = request.headers
        fields = await _read_form(request)
        subject, token = fields.get("subject", ""), fields.get("token", "")
        is_ours = is_same_origin(
            headers.get("host", ""), headers.get("origin", ""), headers.get("sec-fetch-site", "")
        )
        if not is_ours or not self._tokens.check(action, subject, token):
            raise InputError("this form has expired", remedy="Load the page again, and repeat the action.")
        if time.monotonic() - self._acted_s < _MIN_ACTION_INTERVAL_S:
            raise InputError(
                "another action was started a moment ago", remedy="Wait some seconds, and repeat the action."
            )
        self._acted_s = time.monotonic()
        return subject

    def _read_program_pids(self) -> dict[str, int]:
        """Returns the process ids of the programs by name."""
        return {program.record.name: program.record.pid for program in self._collector.snapshot.programs}

    def _create_failure_page(self, error: EnlivenError, status: int = 409) -> Response:
        """Returns the page about an action that failed."""
        return HTMLResponse(self._writer.render_error(error), status)


def _read_picture() -> bytes:
    """Returns the bytes of the picture of the screen (PNG)."""
    return read_file(runtime_folder() / SCREEN_PICTURE_FILE, _MAX_PICTURE_BYTES)


async def _read_form(request: Request) -> dict[str, str]:
    """Returns the fields of a form.

    Raises:
        InputError: if the form is too long.
    """
    data = b""
    async for part in request.stream():
        data += part
        if len(data) > _MAX_FORM_BYTES:
            raise InputError("the submitted form is too long", remedy=_RELOAD_ADVICE)
    try:
        fields = parse_qs(data.decode("utf-8", "replace"), keep_blank_values=True, max_num_fields=8)
    except ValueError:
        raise InputError("the submitted form has too many fields", remedy=_RELOAD_ADVICE) from None
    return {name: values[0] for name, values in fields.items()}
