"""Starts the health page: checks access control and certificate, binds the port, and serves until the program
is stopped."""

from __future__ import annotations

import importlib.util
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from enliven.errors import InputError, ResourceError
from enliven.health import Severity
from enliven.health_page.alert_delivery import AlertSender, alert_targets, deliver_once
from enliven.health_page.alerts import AlertRules, make_alert
from enliven.health_page.collector import HealthCollector
from enliven.health_page.snapshot import Problem
from enliven.keys.key_files import is_loopback
from enliven.kiosk.profile import HealthPageSettings, KioskProfile
from enliven.supervision.notify import Notifier
from enliven.web_server.access import PasswordGate, read_password
from enliven.web_server.certificate import ServerCertificate, load_certificate
from enliven.web_server.listening import bind_port, make_server

log = logging.getLogger(__name__)

LIBRARIES = ("starlette", "uvicorn", "prometheus_client", "jinja2", "cryptography")
"""Libraries of the optional dependency group ``enliven[health]``."""
_PORT_ADVICE = "Another health page may be running. Stop it, or choose another health.port."
"""The remedy for a port that is in use."""


@dataclass(frozen=True)
class PageAccess:
    """The access control of the page.

    Attributes:
        gate: checks passwords. None means that no password is required.
        certificate: the TLS certificate. None means no encryption.
        is_local: True if only this computer can connect.
    """

    gate: PasswordGate | None
    certificate: ServerCertificate | None
    is_local: bool


def check_access(settings: HealthPageSettings) -> PageAccess:
    """Reads the password and the certificate, and checks that they are sufficient for the network address.

    Raises:
        InputError: if the page would be accessible from a network without a password or TLS, or if
            :func:`read_password` or :func:`load_certificate` cannot use a file.
    """
    is_local = is_loopback(settings.host)
    missing = []
    if not settings.password_file:
        missing.append("a password (health.password_file)")
    if not (settings.certificate and settings.certificate_key):
        missing.append("TLS (health.certificate and health.certificate_key)")
    if bool(settings.certificate) != bool(settings.certificate_key):
        raise InputError(
            "only one of health.certificate and health.certificate_key is set",
            where="health",
            remedy="Set both files, or neither.",
        )
    if missing and not is_local:
        raise InputError(
            f"to serve other computers, the health page needs {' and '.join(missing)}",
            where=f"health.host = {settings.host}",
            remedy="Set these values (see docs/health.md), or use host = 127.0.0.1.",
        )
    gate = PasswordGate(read_password(Path(settings.password_file))) if settings.password_file else None
    certificate = None
    if settings.certificate:
        certificate = load_certificate(
            Path(settings.certificate), Path(settings.certificate_key), time.time()
        )
    return PageAccess(gate, certificate, is_local)


def require_libraries() -> None:
    """Raises ResourceError if a required library is not installed. The message contains the installation
    command."""
    missing = [name for name in LIBRARIES if importlib.util.find_spec(name) is None]
    if missing:
        raise ResourceError(
            f"these libraries are not installed: {', '.join(missing)}",
            where="enliven health",
            remedy='Type: pip install "enliven[health]" (in a checkout: pip install "./shared[health]").',
        )


def serve_health(profile: KioskProfile, should_stop: Callable[[], bool] = lambda: False) -> None:
    """Serves the health page until SIGTERM or Ctrl-C.

    Args:
        profile: the profile of the installation.
        should_stop: a function that returns True if the program must end, for example because its parent has
            ended.

    Raises:
        InputError: in the cases of :func:`check_access`, or if the alert settings or the address of an edge
            are invalid.
        ResourceError: in the cases of :func:`enliven.web_server.listening.bind_port`, or if a library is
            missing.
    """
    require_libraries()
    from enliven.health_page.app import HealthApplication

    settings = profile.health
    access = check_access(settings)
    targets = alert_targets(profile.alerts)
    certificate = access.certificate
    with bind_port(settings.host, settings.port, _PORT_ADVICE) as listener:
        collector = HealthCollector(profile, certificate)
        couriers = [AlertSender(target) for target in targets]
        notifier = Notifier()

        def stop() -> None:
            server.should_exit = True

        application = HealthApplication(
            collector,
            AlertRules(profile.name, profile.alerts.quiet),
            couriers,
            notifier,
            should_stop,
            stop,
        )
        server = make_server(
            application.create_asgi_app(access.gate, certificate is not None, access.is_local), certificate
        )
        scheme = "http" if certificate is None else "https"
        host = f"[{settings.host}]" if ":" in settings.host else settings.host
        address = f"{scheme}://{host}:{listener.getsockname()[1]}"
        log.info("The health page is at %s", address)
        notifier.report_ready(f"at {address}")
        try:
            server.run(sockets=[listener])
        finally:
            notifier.report_stopping()
            for courier in couriers:
                courier.close()
            notifier.close()


def send_test_alert(profile: KioskProfile) -> list[str]:
    """Sends a test alert to the webhook and the command of a profile. Returns the names of the targets.

    Raises:
        InputError: if the profile contains no target, or an invalid target.
        ResourceError: if a target did not receive it.
    """
    targets = alert_targets(profile.alerts)
    if not targets:
        raise InputError(
            "the profile contains no receiver of alerts",
            where="alerts",
            remedy="Set alerts.webhook or alerts.command in the profile.",
        )
    problem = Problem("test", "", Severity.NOTE, "This is a test alert.", "No action is needed.")
    faults = deliver_once(targets, make_alert("test", profile.name, problem, time.time()))
    if faults:
        raise ResourceError("; ".join(faults), remedy="Check [alerts] in the profile.")
    return [target.name for target in targets]
