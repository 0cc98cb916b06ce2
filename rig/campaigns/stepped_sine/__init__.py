"""The stepped-sine campaign."""
