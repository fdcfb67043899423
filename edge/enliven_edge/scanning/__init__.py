"""The user's view of a scan: a log of events, advice for a better scan, and views of the mesh."""
