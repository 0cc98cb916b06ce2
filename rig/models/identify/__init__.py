"""Identify models from recordings."""
