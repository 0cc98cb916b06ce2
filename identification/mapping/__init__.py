"""Mappings: where measurements of others are in nested data, and what they mean."""
