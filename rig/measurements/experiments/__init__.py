"""Recordings as training and test data of nonlinear state-space models."""

from rig.measurements.experiments.build import default_rate_hz, experiments

__all__ = ["default_rate_hz", "experiments"]
