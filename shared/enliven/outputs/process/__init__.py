"""The process that sends live outputs, and how its program hands over the frames."""
