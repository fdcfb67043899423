"""Analyses skeletons: finds the facing direction, the limbs, and the joints of humans by their names."""
