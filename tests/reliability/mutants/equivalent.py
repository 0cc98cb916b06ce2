"""Mutants that mean the same as the product, by name, each with its reason. They are left out of every run."""

__all__ = ["EQUIVALENT"]

EQUIVALENT: dict[str, str] = {}
"""Name of a mutant (``path::function: before -> after``, as a run prints it) and why no test can tell it from the product."""
