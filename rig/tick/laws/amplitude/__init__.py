"""The amplitude laws within the tick."""
