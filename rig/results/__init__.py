"""Models, predictions and imported measurements: one folder for each kind of result."""
