"""The VRM exporters: a humanoid model as avatar (.vrm), and the motion of a humanoid alone (.vrma)."""
