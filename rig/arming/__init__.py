"""Arming: who runs the test, what a person must read before anything moves, and what is remembered of a bench."""
