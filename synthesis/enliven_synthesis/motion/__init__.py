"""The performer's motions: named choreographies, walks, exercises and motion captures."""
