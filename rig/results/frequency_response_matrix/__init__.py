"""Frequency response matrices."""
