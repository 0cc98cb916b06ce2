"""Predictions by models, compared with recordings."""
