"""Response-controlled tests: force over frequency and response level, and curves at constant force from it."""
