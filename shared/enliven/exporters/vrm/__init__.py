"""The VRM exporters. They write a humanoid model as an avatar (.vrm), and the motion of a humanoid without
its mesh (.vrma)."""
