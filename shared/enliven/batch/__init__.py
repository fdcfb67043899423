"""Batch retargeting: applies every motion of a plan to every character, in parallel. Runs are repeatable and
can be resumed.
"""
