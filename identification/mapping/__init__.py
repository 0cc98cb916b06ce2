"""Mappings: where the values of an external measurement are in nested data, and what they mean."""
