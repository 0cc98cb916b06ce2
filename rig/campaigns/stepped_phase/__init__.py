"""The stepped-phase campaign."""
