"""Response-controlled tests: the force over frequency and response level, and curves at constant force cut from it."""
