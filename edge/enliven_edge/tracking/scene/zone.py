"""The zone, the floor area for performers, and the lock, which excludes new performers."""

from __future__ import annotations

from collections.abc import Iterable

from enliven.arrays import Float


class Zone:
    """A polygon on the floor. Without corners the zone is the whole floor."""

    def __init__(self, corners: tuple[tuple[float, float], ...] = ()) -> None:
        self.corners = corners

    def contains(self, place: Float, margin: float = 0.0) -> bool:
        """Returns True if a (3,) ``place`` is above the zone, or at most ``margin`` metres outside it."""
        if len(self.corners) < 3:
            return True
        x, z = float(place[0]), float(place[2])
        return self._is_inside(x, z) or (margin > 0 and self._border_distance(x, z) <= margin)

    def _is_inside(self, x: float, z: float) -> bool:
        """Returns True if the point is inside by the even-odd rule: crossings of a ray to +x."""
        inside = False
        for (ax, az), (bx, bz) in self._edges():
            if (az > z) != (bz > z) and x < ax + (z - az) / (bz - az) * (bx - ax):
                inside = not inside
        return inside

    def _border_distance(self, x: float, z: float) -> float:
        """Returns the distance in metres from a floor point to the nearest border of the zone."""
        nearest = float("inf")
        for (ax, az), (bx, bz) in self._edges():
            dx, dz = bx - ax, bz - az
            t = ((x - ax) * dx + (z - az) * dz) / max(1e-12, dx * dx + dz * dz)
            t = min(1.0, max(0.0, t))
            nearest = min(nearest, ((x - ax - t * dx) ** 2 + (z - az - t * dz) ** 2) ** 0.5)
        return nearest

    def _edges(self) -> Iterable[tuple[tuple[float, float], tuple[float, float]]]:
        return zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True)


class ZoneLock:
    """The people who may be performers: all, or only the ``ids`` that were present when it was locked."""

    def __init__(self) -> None:
        self.ids: frozenset[int] | None = None

    @property
    def is_closed(self) -> bool:
        """Returns True if new people are bystanders."""
        return self.ids is not None

    def open(self) -> None:
        """Admits new people as performers again."""
        self.ids = None

    def admits(self, identity: int) -> bool:
        """Returns True if this person is a performer."""
        return self.ids is None or identity in self.ids
