"""Arming: who runs the test, what a person has to read before anything moves, and what is remembered of a bench."""
