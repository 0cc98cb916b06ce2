"""The periods of the oscillator within the tick."""
