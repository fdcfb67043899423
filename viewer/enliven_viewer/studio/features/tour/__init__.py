"""The tour for new users. It points at each step, and detects or demonstrates it."""
