"""Reads the messages of a ROS 2 recording in an SQLite database, as librealsense writes them since 2.57."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import quote

from enliven.errors import InputError
from enliven.files import open_file
from enliven_edge.importing.bags.ros1 import AlignedFields, Message

MAGIC = b"SQLite format 3\0"
_MAX_MESSAGE_BYTES = 1 << 27
"""Maximum bytes of a message; an image has up to 50 MB."""
_MAX_TOPICS = 1000
"""Maximum number of topics in a recording: a camera has some 200, one for each option."""


def messages(path: Path, is_requested: Callable[[str], bool]) -> Iterator[Message]:
    """Yields the messages of the requested topics, in the order of recording.

    Raises:
        InputError: if the file is damaged or not a recording.
    """
    open_file(path).close()
    try:
        with contextlib.closing(_open_database(path)) as database:
            topics = {number: name for number, name in database.execute(_TOPICS) if is_requested(str(name))}
            topic_ids = ",".join(str(int(number)) for number in topics)
            for number, data in database.execute(_MESSAGES.format(topic_ids)):
                topic = str(topics[number])
                yield Message(topic, AlignedFields(bytes(data), f"{path}, {topic}"))
    except (sqlite3.Error, MemoryError, OverflowError, TypeError, ValueError):
        # SQLite reports some damaged pages as a lack of memory.
        problem = "the database is damaged, or is not a recording"
        raise InputError(problem, where=str(path), remedy="Copy the recording again.") from None


_TOPICS = f"SELECT id, name FROM topics LIMIT {_MAX_TOPICS}"
_MESSAGES = "SELECT topic_id, data FROM messages WHERE topic_id IN ({}) ORDER BY id"
_TABLES = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')"
"""Query that counts real tables only, because a view with one of these names could run endlessly."""


def _open_database(path: Path) -> sqlite3.Connection:
    """Opens the database for reading.

    Raises:
        sqlite3.Error: if the file is not a database, or lacks the tables of a recording.
    """
    database = sqlite3.connect(f"file:{quote(str(path))}?mode=ro&immutable=1", uri=True)
    try:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _MAX_MESSAGE_BYTES)
        database.execute("PRAGMA trusted_schema = OFF")
        if database.execute(_TABLES).fetchone() != (2,):
            raise sqlite3.DatabaseError("the database has no messages")
    except BaseException:
        database.close()
        raise
    return database
