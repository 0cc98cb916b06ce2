"""Exchange of data with other programs: UFF (universal files), MAT and CSV."""
