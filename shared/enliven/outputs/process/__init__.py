"""The process that sends live outputs, and the transfer of frames to it."""
