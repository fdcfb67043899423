"""Batch retargeting: applies every motion of a plan to every character, in parallel. An interrupted run can
be resumed.
"""
