"""Hammer tests."""
