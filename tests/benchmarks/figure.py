"""One benchmark result."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A measured value.

    Attributes:
        name: name used in issues and notes.
        value: in ``unit``.
        peer: value of the peer in the same run, or None.
        ratio: factor by which the value is better than the peer's. Above 1 is better. None without a
            peer.
    """

    name: str
    value: float
    unit: str
    peer: str | None = None
    ratio: float | None = None

    def __str__(self) -> str:
        compared = f"  ({self.ratio:.2f} x {self.peer})" if self.ratio is not None else ""
        return f"{self.name}  {self.value:.4g} {self.unit}{compared}"
