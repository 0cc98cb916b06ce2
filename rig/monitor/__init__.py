"""A run as a person watches it: on a page, in a terminal, while it goes on or replayed from its recording.

Nothing here is imported by a process that drives a rig.
"""
