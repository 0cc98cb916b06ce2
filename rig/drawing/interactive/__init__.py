"""Figures that are read in a browser: one file with everything in it, with zoom and what stands at a point (decision 0119)."""
