"""Chapters of a report on a folder of `rig reproduce`, with the paper's numbers beside ours."""
