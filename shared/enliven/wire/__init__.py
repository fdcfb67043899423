"""The wire: messages between edge and viewer, their one table of topics, and the compression of poses."""
