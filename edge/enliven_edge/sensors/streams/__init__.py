"""Motion from other programs as sensors: VMC bones, Rokoko actors and OSC trackers become bodies."""
