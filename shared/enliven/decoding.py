"""The errors of decoding damaged JSON and MessagePack."""

from __future__ import annotations

import msgspec

DECODE_ERRORS = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
"""The exceptions of msgspec's decoders for damaged data. Text that is not UTF-8 raises no MsgspecError."""
