"""The access to an edge with keys: its key pair, the paired viewers, and the pairing code."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable

from enliven.errors import EnlivenError
from enliven.keys.key_files import KeyPair, KeyStore, PairedViewer, fingerprint
from enliven.keys.pairing import Introduction, PairingCodes, PairingError, limit_role
from enliven.keys.roles import Role
from enliven.wire import FinishPairing, Paired, PairingStarted, Refused, ShowCode, ShownCode, StartPairing
from enliven_edge.network.connection import Connection
from enliven_edge.network.server import ZmtpServer
from enliven_edge.network.tcp_listener import check_open, is_local
from enliven_edge.settings import WireSettings

log = logging.getLogger(__name__)

_REFRESH_INTERVAL_S = 2.0
"""Seconds between two checks of the folder of paired viewers, which other programs may change."""
_MAX_VIEWERS = 500
"""Maximum number of paired viewers. When it is reached, no further viewer can pair."""

_CODE_DISPLAY_S = 300.0
"""Seconds in which viewers can pair after an operator has requested the pairing code."""
PairingRequest = StartPairing | FinishPairing | ShowCode
PairingAnswer = PairingStarted | Paired | ShownCode | Refused


class Access:
    """Decides which viewers connect to an edge with keys, and pairs new ones.

    Args:
        name: the edge's name, which is sent to paired viewers.
        keys: the edge's key pair. Viewers that have the same pair belong to the edge's user, and may do
            everything.
        store: the files of paired viewers.
        highest: the highest role that a new pairing grants.
        open_s: seconds from now in which viewers can pair.

    Attributes:
        curve: the keys and the admitted viewers, for the sockets.
        desk: manages the pairing code.
    """

    def __init__(
        self, name: str, keys: KeyPair, store: KeyStore, *, highest: Role = "operate", open_s: float = 0.0
    ) -> None:
        self._name, self._keys, self._store, self._highest = name, keys, store, highest
        self._viewers: dict[bytes, PairedViewer] = {}
        self._stamp, self._refreshed_at = -1, 0.0
        self._logged_problems: set[str] = set()
        # Import it here, because an edge without keys does not need libsodium.
        from enliven.keys.curve import CurveServer

        self.curve = CurveServer(keys, lambda public: self.viewer_role(public) is not None)
        self.desk = PairingCodes(_log_code)
        self.open_s = open_s
        self.refresh(immediately=True)

    def open_pairing(self) -> None:
        """Accepts pairings for the first minutes after the start of the edge."""
        log.info("only paired viewers can connect; %d are paired", len(self._viewers))
        if self.open_s:
            self.desk.open_for(self.open_s)

    def viewer_role(self, public: bytes | None) -> Role | None:
        """Returns the role of a viewer by its public key. Returns None if it is not paired."""
        if public is None:
            return None
        if public == self._keys.public:
            return "operate"
        viewer = self._viewers.get(public)
        return None if viewer is None else viewer.role

    def refresh(self, *, immediately: bool = False) -> bool:
        """Reads the paired viewers again if a file was added or removed. Returns True if they have changed.

        Files that cannot be used are logged once, and their viewers are not admitted.
        """
        if not immediately and time.monotonic() - self._refreshed_at < _REFRESH_INTERVAL_S:
            return False
        self._refreshed_at = time.monotonic()
        stamp = self._store.read_change_counter()
        if not immediately and stamp == self._stamp:
            return False
        problems: list[str] = []
        self._stamp, self._viewers = stamp, self._store.load_viewers(problems)
        for problem in problems:
            if problem not in self._logged_problems:
                log.warning("a paired viewer cannot connect: %s", problem)
                self._logged_problems.add(problem)
        return True

    def enforce_pairing(self, servers: Iterable[ZmtpServer]) -> None:
        """Renews the pairing code when it is due, and disconnects viewers that are not paired any more."""
        self.desk.poll()
        if not self.refresh():
            return
        for server in servers:
            for peer in list(server.connections):
                channel = peer.session.channel
                if channel is not None and channel.is_ready and self.viewer_role(channel.client) is None:
                    server.close_connection(peer)

    def answer(self, request: PairingRequest, peer: Connection) -> PairingAnswer:
        """Answers a request about pairing."""
        try:
            match request:
                case StartPairing():
                    peer.pairing = None
                    peer.pairing = self.desk.start_pairing(request.message)
                    return PairingStarted(peer.pairing.message)
                case FinishPairing():
                    return self._finish_pairing(request.box, peer)
                case ShowCode():
                    self.desk.open_for(_CODE_DISPLAY_S)
                    return ShownCode(self.desk.code, self.desk.seconds_left or round(self.desk.pause_s))
        except PairingError as error:
            log.warning("a pairing from %s was refused: %s", peer.address, error)
            return Refused(str(error)[:400])

    def _finish_pairing(self, box: bytes, peer: Connection) -> Paired | Refused:
        """Stores the viewer that sent the right code, and answers with the edge's key."""
        exchange, peer.pairing = peer.pairing, None
        if exchange is None:
            raise PairingError("pairing was not started on this connection")
        viewer = exchange.decrypt_introduction(box)
        role = limit_role(viewer.role, self._highest)
        if viewer.public not in self._viewers and len(self._viewers) >= _MAX_VIEWERS:
            raise PairingError(
                f"{_MAX_VIEWERS} viewers are already paired. Remove some of them: enliven keys forget"
            )
        try:
            self._store.add_viewer(PairedViewer(viewer.public, viewer.name, role))
        except EnlivenError as error:
            raise PairingError(str(error)) from None
        self.desk.finish_pairing()
        self.refresh(immediately=True)
        log.info(
            "%s is paired, with the role %s and the key %s", viewer.name, role, fingerprint(viewer.public)
        )
        return Paired(exchange.encrypt_introduction(Introduction(self._keys.public, self._name, role)))


def peer_role(access: Access | None, peer: Connection, without_keys: Role) -> Role | None:
    """Returns the role of a connected peer. Returns None if it is not paired.

    Args:
        access: the access to the edge; None if it uses no keys.
        without_keys: the role of every peer if no keys are used.
    """
    if access is None:
        return without_keys
    channel = peer.session.channel
    return None if channel is None else access.viewer_role(channel.client)


def open_access(wire: WireSettings, store: KeyStore | None = None) -> Access | None:
    """Returns the access to an edge, or None for an edge without keys. Logs the consequences.

    Raises:
        InputError: if other machines reach the address without keys, unless ``insecure`` is set.
    """
    local = is_local(wire.host)
    if wire.insecure:
        if not local:
            log.warning(
                "--insecure: everyone who can reach %s can watch the performers and the room, possess, "
                "add and remove characters, scan, and lock the cast. Nothing is encrypted",
                wire.host or "*",
            )
        return None
    store = store or KeyStore()
    keys = store.load_own_pair()
    if keys is not None:
        open_s = 0.0 if local else 60.0 * wire.pairing_minutes
        return Access(wire.name, keys, store, highest=wire.pairing_role, open_s=open_s)
    check_open(wire.host, open_to_all=False)
    return None


def _log_code(code: str) -> None:
    """Logs the pairing code. The log is the terminal unless it is redirected."""
    log.info("to pair a viewer, type on its computer: enliven pair HOST %s %s", code[:3], code[3:])
