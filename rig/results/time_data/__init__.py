"""Time records measured with other systems."""
