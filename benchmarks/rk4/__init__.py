"""The classic Runge-Kutta method on the same rig: what the exponential integrator is measured against."""
