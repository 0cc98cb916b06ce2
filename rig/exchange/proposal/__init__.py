"""Mappings of time data that are proposed for a file: what is in it, what that may be, and the text."""
