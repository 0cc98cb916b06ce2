"""Evaluate sampled signals: Fourier coefficients, transients over time, sweeps, decimation."""
