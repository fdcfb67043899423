"""Hardware controls in addition to a viewer's keys: pedals, clickers, button panels and spoken phrases.

Each control is read on its own thread and produces commands. The edge takes the commands between two frames.
"""
