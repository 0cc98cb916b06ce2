"""Bayesian fit of the linear rig near one mode: physical parameters from measured responses and priors."""
