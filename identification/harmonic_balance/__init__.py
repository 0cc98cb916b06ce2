"""Steady vibrations of any model by harmonic balance and continuation."""
