"""Figures of recordings, models and imported measurements, in one style."""

from rig.figures.draw import plot

__all__ = ["plot"]
