"""Predictions with nonlinear modes."""
