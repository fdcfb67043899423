"""What the viewport needs to show and pick: lens, hits, overlays, colours, players and the selection."""
