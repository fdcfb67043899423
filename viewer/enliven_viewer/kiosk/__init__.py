"""The kiosk's window: shows the interactive story to visitors, and reports its state to operators."""
