"""From models to predictions, beside the recordings they are compared with."""
