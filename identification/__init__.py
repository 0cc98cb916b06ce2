"""Measurements in memory, models of nonlinear modes, and their scores."""
