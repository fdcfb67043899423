"""Physics simulation: rigid boxes and balls that characters and performers push (an optional extra)."""
