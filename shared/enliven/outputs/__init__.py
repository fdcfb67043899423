"""Live outputs: sends characters and performers to other programs (VMC, VRChat, Rokoko, OSC, Foxglove)."""
