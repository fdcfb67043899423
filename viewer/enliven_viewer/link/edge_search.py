"""The search for edges on the network, with a small camera image of each."""

from __future__ import annotations

import logging
import threading

from enliven.errors import EnlivenError
from enliven.peers.announcement import find_missing_discovery_reason
from enliven.peers.edge_browser import DiscoveredEdge, EdgeBrowser
from enliven.wire import CameraMessage
from enliven_viewer.link.camera_glance import CameraGlance

log = logging.getLogger(__name__)

_MAX_PICTURES = 8
"""Maximum number of edges with a camera image. Further edges are listed without an image."""


class EdgeSearch:
    """A search that runs while the list of edges is visible.

    Attributes:
        problem: reason why the search is impossible; empty if it works.
    """

    def __init__(self) -> None:
        self.problem = ""
        self._browser: EdgeBrowser | None = None
        self._glances: dict[str, CameraGlance] = {}

    @property
    def edges(self) -> tuple[DiscoveredEdge, ...]:
        """Returns the edges that have been found."""
        return () if self._browser is None else self._browser.edges

    def poll(self) -> None:
        """Starts the search if it has not started yet, and receives camera images. Call once per frame."""
        if self._browser is None and not self.problem:
            self.problem = find_missing_discovery_reason()
            try:
                self._browser = None if self.problem else EdgeBrowser()
            except EnlivenError as error:
                self.problem = str(error)
                log.debug("edges on the network cannot be searched: %s", error)
        self._keep_glances()
        for glance in self._glances.values():
            glance.poll()

    def camera(self, edge: DiscoveredEdge) -> CameraMessage | None:
        """Returns the newest camera image of an edge, or None if there is none."""
        glance = self._glances.get(edge.service)
        return None if glance is None else glance.camera

    def close(self) -> None:
        """Ends the search. The next :meth:`poll` starts it again."""
        for glance in self._glances.values():
            glance.close()
        self._glances.clear()
        if self._browser is not None:
            # Closing the mDNS browser can take a second.
            threading.Thread(target=self._browser.close, name="end of search", daemon=True).start()
        self._browser, self.problem = None, ""

    def _keep_glances(self) -> None:
        """Opens connections to new edges, and closes those to edges that have gone or have a new address."""
        endpoint_by_service = {edge.service: edge.endpoint for edge in self.edges if edge.is_usable}
        for service in [s for s, g in self._glances.items() if endpoint_by_service.get(s) != g.endpoint]:
            self._glances.pop(service).close()
        for service, endpoint in endpoint_by_service.items():
            if service not in self._glances and len(self._glances) < _MAX_PICTURES:
                self._glances[service] = CameraGlance(endpoint)
