"""Linear modal analysis of frequency responses."""
