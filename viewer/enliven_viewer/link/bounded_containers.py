"""Containers with limits on values and bytes, so that an edge cannot fill a viewer's memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class BoundedQueue(Generic[T]):
    """A queue that drops its oldest values if it exceeds its limits.

    Args:
        max_values: maximum number of values.
        max_bytes: maximum size of all values in bytes. A single value is kept regardless of its size.
    """

    def __init__(self, max_values: int, max_bytes: int) -> None:
        self._most, self._most_bytes = max_values, max_bytes
        self._held: deque[tuple[T, int]] = deque()
        self.bytes = 0

    def __len__(self) -> int:
        return len(self._held)

    def __bool__(self) -> bool:
        return bool(self._held)

    def __iter__(self) -> Iterator[T]:
        return (value for value, _ in self._held)

    def append(self, value: T, size: int) -> None:
        """Adds a value with its size in bytes."""
        self._held.append((value, size))
        self.bytes += size
        while len(self._held) > self._most or (self.bytes > self._most_bytes and len(self._held) > 1):
            self.popleft()

    def popleft(self) -> T:
        """Removes the oldest value and returns it."""
        value, size = self._held.popleft()
        self.bytes -= size
        return value

    def take_all(self) -> list[T]:
        """Removes all values and returns them, oldest first."""
        values = [value for value, _ in self._held]
        self._held.clear()
        self.bytes = 0
        return values


class NewestValues(dict[str, Any]):
    """The newest value of each key.

    If the limits are exceeded, the least recently updated keys are dropped.

    Args:
        max_values: maximum number of keys.
        max_bytes: maximum size of all values in bytes. One value is kept regardless of its size.
    """

    def __init__(self, max_values: int, max_bytes: int) -> None:
        super().__init__()
        self._most, self._most_bytes = max_values, max_bytes
        self._sizes: dict[str, int] = {}
        self.bytes = 0

    def set_newest(self, key: str, value: Any, size: int) -> None:
        """Sets the newest value of a key, with its size in bytes."""
        self.forget(key)
        self[key], self._sizes[key] = value, size
        self.bytes += size
        while len(self) > self._most or (self.bytes > self._most_bytes and len(self) > 1):
            self.forget(next(iter(self)))

    def forget(self, key: str) -> None:
        """Removes a key if it exists."""
        self.pop(key, None)
        self.bytes -= self._sizes.pop(key, 0)

    def take_all(self) -> list[Any]:
        """Removes all values and returns them, the most recently updated value last."""
        values = list(self.values())
        self.clear()
        self._sizes.clear()
        self.bytes = 0
        return values
