"""The state of one output, as reported by the sending process."""

from __future__ import annotations


class OutputStatus:
    """Packet counts of one output, summed over all restarts of the sending process.

    Args:
        name: name of the output, for messages.

    Attributes:
        trouble: the reason why frames are being lost. Empty if the output works.
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

    def add_counts(self, sent: int, errors: int, trouble: str) -> None:
        """Stores the counts that the running process reports."""
        self._now, self.trouble = (sent, errors), trouble

    def end_process(self, trouble: str) -> None:
        """Adds the counts of a process that has ended to the totals."""
        self._before, self._now, self.trouble = (self.sent, self.errors), (0, 0), trouble
