"""A driver for the box: take it apart and put your device in its place."""

from vibrolock_box.driver import BoxDAQ

__all__ = ["BoxDAQ"]
