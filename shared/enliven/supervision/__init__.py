"""Supervision of programs that run for weeks: progress reports, restarts, and records of their state on
disk.
"""
