"""What fits of all models share: bounded least squares and threads."""
