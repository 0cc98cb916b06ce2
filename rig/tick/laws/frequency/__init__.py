"""The frequency law within the tick."""
