"""Nonlinear state-space models (PNLSS)."""
