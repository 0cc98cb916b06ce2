"""The integrator by itself, without sensors and tick."""
