"""The link to edges and takes: messages received, clocks aligned, requests sent."""
