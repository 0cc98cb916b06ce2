"""Data to and from other programs: UFF (universal files), MAT and CSV."""
