"""The state of one output, as its process has reported it."""

from __future__ import annotations


class OutputStatus:
    """Counts the packets of one output, over all processes that have sent it.

    Args:
        name: of the output, for messages.

    Attributes:
        trouble: why frames are lost now. Empty if the output works.
    """

    def __init__(self, name: str) -> None:
        self.name, self.trouble = name, ""
        self._before = self._now = (0, 0)

    @property
    def sent(self) -> int:
        """Number of packets or messages that were sent."""
        return self._before[0] + self._now[0]

    @property
    def errors(self) -> int:
        """Number of packets or frames that were not sent."""
        return self._before[1] + self._now[1]

    def update(self, sent: int, errors: int, trouble: str) -> None:
        """Takes the numbers of the running process."""
        self._now, self.trouble = (sent, errors), trouble

    def end_process(self, trouble: str) -> None:
        """Keeps the numbers of a process that has ended."""
        self._before, self._now, self.trouble = (self.sent, self.errors), (0, 0), trouble
