"""Figures of recordings, models and measurements."""
