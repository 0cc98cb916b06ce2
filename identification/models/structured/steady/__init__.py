"""Steady vibrations of structured models, by harmonic balance of the continuous equation of motion."""
