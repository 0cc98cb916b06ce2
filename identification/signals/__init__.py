"""From sampled signals to what they hold: Fourier coefficients, transients over time, sweeps, fewer samples."""
