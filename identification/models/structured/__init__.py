"""Structured nonlinear state-space models: modes with nonlinear elements between them."""
