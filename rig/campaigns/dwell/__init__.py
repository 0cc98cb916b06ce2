"""The dwell campaign: resonance track and dwell."""
