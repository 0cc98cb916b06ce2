"""Multisines: their design and the spectra of their recordings."""
