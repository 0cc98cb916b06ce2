"""Demodulation: synchronous, by adaptive filter, by signs."""
