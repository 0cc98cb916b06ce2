"""Files of models, predictions and imported measurements: one description per kind."""
