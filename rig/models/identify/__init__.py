"""From recordings to models."""
