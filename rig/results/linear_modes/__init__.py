"""Linear modes."""
