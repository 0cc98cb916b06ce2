"""Carrying out a plan: the runner, the execution of a part, continuation, output file, limits and trips."""
