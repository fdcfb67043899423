"""The timeline: rows (lanes) with the clips of takes, the transport buttons with loops, and
edits of clips.
"""
