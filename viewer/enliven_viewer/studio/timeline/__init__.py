"""The timeline's lanes: where they are, and what a drag on them edits."""
