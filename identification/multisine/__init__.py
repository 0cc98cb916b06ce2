"""Multisines: their design, and the spectra of what was recorded under them."""
