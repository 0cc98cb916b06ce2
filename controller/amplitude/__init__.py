"""The amplitude laws: loops that hold a force or a response."""
