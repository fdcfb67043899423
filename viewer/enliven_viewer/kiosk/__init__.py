"""The kiosk's window: shows the story to visitors, and reports to operators."""
