"""Experiments, models that simulate them, and time records from elsewhere that become experiments."""
