"""The continuous backbone campaign."""
