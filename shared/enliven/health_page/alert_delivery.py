"""Delivers alerts to a webhook and to a command, in the background and with retries."""

from __future__ import annotations

import contextlib
import logging
import os
import queue
import shlex
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from typing import Protocol

from enliven.errors import InputError, ResourceError
from enliven.health_page.alerts import Alert
from enliven.kiosk.profile import AlertSettings

log = logging.getLogger(__name__)

WEBHOOK_TIMEOUT_S = 10.0
"""Timeout, in seconds, of the connection to a webhook and of each response."""
COMMAND_TIMEOUT_S = 30.0
"""Time in seconds after which a command is killed."""
FIRST_RETRY_S = 5.0
"""Delay before the second attempt, in seconds. The delay doubles with each attempt."""
MAX_RETRY_S = 300.0
"""Maximum delay between two attempts, in seconds."""
GIVE_UP_AFTER_S = 3600.0
"""Time in seconds after which an undelivered alert is dropped, because it is outdated."""
_MAX_QUEUED_ALERTS = 200
"""Maximum number of queued alerts. Further alerts are dropped."""
_CLOSING_TIMEOUT_S = 2.0
"""Maximum time to wait for a running delivery when the program ends, in seconds."""


class AlertTarget(Protocol):
    """A receiver of alerts."""

    name: str

    def deliver(self, alert: Alert) -> None:
        """Delivers one alert. May block for some seconds.

        Raises:
            ResourceError: if the alert was not delivered.
        """


class WebhookTarget:
    """A webhook, that is, a URL that receives each alert as JSON by POST.

    HTTP redirects count as failures, so that alerts are sent only to the configured host.

    Args:
        url: the address.

    Raises:
        InputError: if it is not an http or https address.
    """

    def __init__(self, url: str) -> None:
        from urllib.parse import urlsplit

        # The path may contain a secret token, so only the host is shown and logged.
        try:
            parts = urlsplit(url)
            host = parts.hostname
        except ValueError:
            host = None
        if not host or parts.scheme not in ("http", "https") or not url.isprintable() or " " in url:
            raise InputError(
                "alerts.webhook is not a web address",
                where="alerts",
                remedy="Write https://HOST/PATH, or leave alerts.webhook empty.",
            )
        self._url = url
        self.name = f"webhook at {host}"

    def deliver(self, alert: Alert) -> None:
        """Sends one alert. Raises the errors of :meth:`AlertTarget.deliver`."""
        from http.client import HTTPException
        from urllib.request import HTTPHandler, HTTPSHandler, OpenerDirector, ProxyHandler, Request

        opener = OpenerDirector()
        for handler in (ProxyHandler(), HTTPHandler(), HTTPSHandler()):
            opener.add_handler(handler)
        headers = {"Content-Type": "application/json", "User-Agent": "enliven"}
        request = Request(self._url, data=alert.json(), headers=headers, method="POST")
        try:
            with opener.open(request, timeout=WEBHOOK_TIMEOUT_S) as answer:
                status = int(answer.status)
        except (OSError, HTTPException, ValueError) as error:
            reason = getattr(error, "reason", error)
            raise ResourceError(
                f"the receiver of the alert does not answer ({reason})", where=self.name
            ) from None
        if not 200 <= status < 300:
            raise ResourceError(f"the receiver refused the alert with HTTP status {status}", where=self.name)


class CommandTarget:
    """A command that receives each alert as JSON on its standard input. No shell is involved.

    Args:
        command: the command and its arguments, quoted as in a shell.

    Raises:
        InputError: if a quote is not closed.
    """

    def __init__(self, command: str) -> None:
        try:
            self._words = shlex.split(command)
        except ValueError as error:
            raise InputError(
                f"the command in alerts.command is not valid ({error})",
                where="alerts",
                remedy="Check the quotes in the command.",
            ) from None
        if not self._words:
            raise InputError("alerts.command is empty", where="alerts", remedy="Write the name of a program.")
        self.name = f"command {self._words[0]}"

    def deliver(self, alert: Alert) -> None:
        """Runs the command for one alert. Raises the errors of :meth:`AlertTarget.deliver`."""
        try:
            process = subprocess.Popen(
                self._words, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True
            )
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ResourceError(f"the alert command cannot be started ({reason})", where=self.name) from None
        try:
            # A command may end without reading its input. This is not an error.
            with contextlib.suppress(BrokenPipeError):
                process.communicate(alert.json() + b"\n", timeout=COMMAND_TIMEOUT_S)
            code = process.wait(timeout=COMMAND_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            _kill_group(process)
            raise ResourceError(
                f"the alert command did not end within {COMMAND_TIMEOUT_S:g} s, so it was killed",
                where=self.name,
            ) from None
        if code != 0:
            raise ResourceError(f"the alert command failed with exit code {code}", where=self.name)


class AlertSender:
    """A thread that delivers the alerts of one target in order.

    Attributes:
        sent: number of delivered alerts.
        failures: number of failed attempts.
        fault: the reason why the last attempt failed. Empty after a success.
    """

    def __init__(self, target: AlertTarget) -> None:
        self._target = target
        self._alerts: queue.Queue[Alert | None] = queue.Queue(_MAX_QUEUED_ALERTS)
        self._is_closing = threading.Event()
        self.sent = self.failures = 0
        self.fault = ""
        self._thread = threading.Thread(
            target=self._send_queued_alerts, name=f"alerts to {target.name}", daemon=True
        )
        self._thread.start()

    def enqueue_alert(self, alert: Alert) -> None:
        """Adds an alert to the queue. Never blocks. If the queue is full, the alert is dropped."""
        try:
            self._alerts.put_nowait(alert)
        except queue.Full:
            log.warning(
                "%s: an alert was dropped, because %d alerts are already waiting.",
                self._target.name,
                _MAX_QUEUED_ALERTS,
            )

    def close(self) -> None:
        """Ends the thread. Queued alerts are dropped."""
        self._is_closing.set()
        with contextlib.suppress(queue.Full):
            self._alerts.put_nowait(None)
        self._thread.join(_CLOSING_TIMEOUT_S)

    def _send_queued_alerts(self) -> None:
        while not self._is_closing.is_set():
            alert = self._alerts.get()
            if alert is not None:
                self._deliver_with_retries(alert)

    def _deliver_with_retries(self, alert: Alert) -> None:
        """Delivers one alert. Retries until :data:`GIVE_UP_AFTER_S` has passed."""
        wait_s, end = FIRST_RETRY_S, time.monotonic() + GIVE_UP_AFTER_S
        while not self._is_closing.is_set():
            try:
                self._target.deliver(alert)
            except ResourceError as error:
                self.failures += 1
                self.fault = str(error)
                if time.monotonic() + wait_s > end:
                    log.warning("%s. The alert about %s was dropped.", error, alert.kind)
                    return
                log.warning("%s. The alert about %s will be sent again in %g s.", error, alert.kind, wait_s)
                self._is_closing.wait(wait_s)
                wait_s = min(2.0 * wait_s, MAX_RETRY_S)
            except Exception:
                # An unexpected error must not end the thread, which also delivers all later alerts.
                self.failures += 1
                self.fault = f"{self._target.name}: an internal error of enliven occurred"
                log.exception("The alert about %s was dropped because of an internal error.", alert.kind)
                return
            else:
                self.sent += 1
                self.fault = ""
                return


def alert_targets(settings: AlertSettings) -> list[AlertTarget]:
    """Returns the alert targets in the settings.

    Raises:
        InputError: if an address or a command is invalid.
    """
    targets: list[AlertTarget] = []
    if settings.webhook:
        targets.append(WebhookTarget(settings.webhook))
    if settings.command.strip():
        targets.append(CommandTarget(settings.command))
    return targets


def deliver_once(targets: Sequence[AlertTarget], alert: Alert) -> list[str]:
    """Delivers an alert to all targets without retries. Returns a sentence for each failure."""
    faults = []
    for target in targets:
        try:
            target.deliver(alert)
        except ResourceError as error:
            faults.append(str(error))
    return faults


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    """Kills a process and its child processes."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()
