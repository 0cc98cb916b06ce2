"""Force surfaces."""
