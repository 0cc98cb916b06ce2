"""Models, predictions and imported measurements: their files, and their identification from recordings."""
