"""Simulation of a nonlinear state-space model together with the exciter that drives it, from a voltage."""
