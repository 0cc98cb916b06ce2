"""Evaluate the recorded rows of a point: results and quality, shared by several kinds of campaigns."""
