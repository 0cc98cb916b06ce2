"""Fit all parameters of a nonlinear state-space model to experiments, in the time domain."""
