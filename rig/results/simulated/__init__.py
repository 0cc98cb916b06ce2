"""What models that are simulated have in common: data, errors, predictions."""
