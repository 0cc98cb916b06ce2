"""Rehearsal: a plan, unchanged, on many virtual twins of a bench, before anything moves."""
