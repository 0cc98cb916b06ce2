"""Nonlinear modes: modal properties over the vibration level, from backbones and stepped sines."""
