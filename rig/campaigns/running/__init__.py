"""Carry out a plan: runner, execution of a part, continuation, output file, limits and trips."""
