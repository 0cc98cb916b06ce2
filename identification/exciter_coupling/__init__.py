"""Exciters: identification, and simulation of models that an exciter drives."""
