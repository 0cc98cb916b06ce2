"""The sweep campaign."""
