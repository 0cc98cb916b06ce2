"""Figures of what is in files and of results in memory."""
