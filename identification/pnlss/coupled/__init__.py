"""A nonlinear state-space model and the exciter that drives it, simulated together from a voltage."""
