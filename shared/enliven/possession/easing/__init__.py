"""Easing: moves the displayed mesh without jumps when performers attach or release it, and lets soft parts
swing.
"""
