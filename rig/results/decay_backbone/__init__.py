"""Decays: modal frequency and damping over the amplitude."""
