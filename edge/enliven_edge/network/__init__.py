"""The edge's network: TCP servers with bounded queues, the streams to viewers, and their requests."""
