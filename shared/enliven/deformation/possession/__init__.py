"""Possession: which graph nodes a performer's bones take hold of (KinÊtre, 2012)."""
