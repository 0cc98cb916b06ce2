"""The backbone campaign."""
