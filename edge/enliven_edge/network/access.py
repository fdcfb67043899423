"""The access to an edge with keys: its key pair, the paired viewers, and the pairing code."""

from __future__ import annotations

import logging
import time

from enliven.errors import EnlivenError
from enliven.keys import (
    Introduction,
    KeyPair,
    KeyStore,
    PairedViewer,
    PairingDesk,
    PairingError,
    Role,
    fingerprint,
    limit_role,
)
from enliven.wire import FinishPairing, Paired, PairingStarted, Refused, ShowCode, ShownCode, StartPairing
from enliven_edge.network.connection import Connection
from enliven_edge.network.tcp_listener import check_open, is_local
from enliven_edge.settings import WireSettings

log = logging.getLogger(__name__)

_REFRESH_INTERVAL_S = 2.0
"""Seconds between two looks at the folder of paired viewers, which other programs change."""
_MAX_VIEWERS = 500
"""Maximum number of paired viewers. Beyond it no further viewer can pair."""

_SHOWN_S = 300.0
"""Seconds in which viewers can pair after an operator has asked for the code."""
PairingRequest = StartPairing | FinishPairing | ShowCode
PairingAnswer = PairingStarted | Paired | ShownCode | Refused


class Access:
    """Decides which viewers connect to an edge with keys, and pairs new ones.

    Args:
        name: the edge's name, which paired viewers get.
        keys: the edge's key pair. Viewers that have the same pair belong to the edge's user, and may do
            everything.
        store: the files of paired viewers.
        highest: the highest role that a pairing grants.
        open_s: seconds from now in which viewers can pair.

    Attributes:
        curve: the keys and the admitted viewers, for the sockets.
        desk: the pairing code.
    """

    def __init__(
        self, name: str, keys: KeyPair, store: KeyStore, *, highest: Role = "operate", open_s: float = 0.0
    ) -> None:
        self._name, self._keys, self._store, self._highest = name, keys, store, highest
        self._viewers: dict[bytes, PairedViewer] = {}
        self._stamp, self._refreshed_at = -1, 0.0
        self._logged_problems: set[str] = set()
        # Imported here, because an edge without keys does not need libsodium.
        from enliven.keys import CurveServer

        self.curve = CurveServer(keys, lambda public: self.role_of(public) is not None)
        self.desk = PairingDesk(_log_code)
        self.open_s = open_s
        self.refresh(now=True)

    def begin(self) -> None:
        """Accepts pairings for the first minutes of the edge."""
        log.info("only paired viewers can connect; %d are paired", len(self._viewers))
        if self.open_s:
            self.desk.open_for(self.open_s)

    def role_of(self, public: bytes | None) -> Role | None:
        """Returns the role of a viewer by its public key. None: it is not paired."""
        if public is None:
            return None
        if public == self._keys.public:
            return "operate"
        viewer = self._viewers.get(public)
        return None if viewer is None else viewer.role

    def refresh(self, *, now: bool = False) -> bool:
        """Reads the paired viewers again if a file was added or removed. Returns True if it did.

        Files that cannot be used are logged once, and their viewers are not admitted.
        """
        if not now and time.monotonic() - self._refreshed_at < _REFRESH_INTERVAL_S:
            return False
        self._refreshed_at = time.monotonic()
        stamp = self._store.stamp()
        if not now and stamp == self._stamp:
            return False
        problems: list[str] = []
        self._stamp, self._viewers = stamp, self._store.viewers(problems)
        for problem in problems:
            if problem not in self._logged_problems:
                log.warning("a paired viewer is not admitted: %s", problem)
                self._logged_problems.add(problem)
        return True

    def answer(self, request: PairingRequest, peer: Connection) -> PairingAnswer:
        """Answers a request about pairing."""
        try:
            match request:
                case StartPairing():
                    peer.pairing = None
                    peer.pairing = self.desk.start(request.message)
                    return PairingStarted(peer.pairing.message)
                case FinishPairing():
                    return self._finish(request.box, peer)
                case ShowCode():
                    self.desk.open_for(_SHOWN_S)
                    return ShownCode(self.desk.code, self.desk.seconds_left or round(self.desk.pause_s))
        except PairingError as error:
            log.warning("a pairing from %s was refused: %s", peer.address, error)
            return Refused(str(error)[:400])

    def _finish(self, box: bytes, peer: Connection) -> Paired | Refused:
        """Stores the viewer that knew the code, and answers with the edge's key."""
        exchange, peer.pairing = peer.pairing, None
        if exchange is None:
            raise PairingError("the pairing was not started on this connection")
        viewer = exchange.read(box)
        role = limit_role(viewer.role, self._highest)
        if viewer.public not in self._viewers and len(self._viewers) >= _MAX_VIEWERS:
            raise PairingError(f"{_MAX_VIEWERS} viewers are paired already; forget some: enliven keys forget")
        try:
            self._store.add_viewer(PairedViewer(viewer.public, viewer.name, role))
        except EnlivenError as error:
            raise PairingError(str(error)) from None
        self.desk.succeed()
        self.refresh(now=True)
        log.info("%s is paired, with the role %s: %s", viewer.name, role, fingerprint(viewer.public))
        return Paired(exchange.introduce(Introduction(self._keys.public, self._name, role)))


def open_access(wire: WireSettings, store: KeyStore | None = None) -> Access | None:
    """Returns the access to an edge, or None for an edge without keys. The log states the consequences.

    Raises:
        InputError: if other machines reach the address without keys, unless ``insecure`` is set.
    """
    local = is_local(wire.host)
    if wire.insecure:
        if not local:
            log.warning(
                "--insecure: everyone that reaches %s can watch the performers and the room, possess, add "
                "and remove characters, scan, and lock the cast. Nothing is encrypted",
                wire.host or "*",
            )
        return None
    store = store or KeyStore()
    keys = store.own()
    if keys is not None:
        open_s = 0.0 if local else 60.0 * wire.pairing_minutes
        return Access(wire.name, keys, store, highest=wire.pairing_role, open_s=open_s)
    check_open(wire.host, open_to_all=False)
    return None


def _log_code(code: str) -> None:
    """Shows a code in the log, which is the terminal unless it is redirected."""
    log.info("to pair a viewer, run there: enliven pair HOST %s %s", code[:3], code[3:])
