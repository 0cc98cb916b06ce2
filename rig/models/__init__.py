"""Models, predictions and imported measurements: their files, and how they come from recordings."""
