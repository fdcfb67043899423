"""The timeline's lanes: their layout, and the edits that a drag on them makes."""
