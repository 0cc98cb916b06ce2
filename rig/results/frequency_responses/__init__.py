"""Stepped-sine frequency responses."""
