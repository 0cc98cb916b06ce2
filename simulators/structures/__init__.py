"""Vibrating structures: beams and lap joints by finite elements, and structures given by their modes."""
