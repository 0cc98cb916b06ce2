"""Changes from run to run as part of a model: its linear part shifts along its modes."""
