"""The timeline: its lanes with clips and takes, the transport with loops, and the edits made on them."""
