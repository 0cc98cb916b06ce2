"""Slow flow of a phase-locked vibration: modal properties at every instant, without waiting for a steady state."""
