"""Controls beside a viewer's keys: pedals, clickers, button panels and spoken phrases.

A control is read on a thread of its own and says a command; the edge takes the commands between two frames.
"""
