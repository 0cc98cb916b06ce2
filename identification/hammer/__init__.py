"""Hammer tests: hits found in records of force and motions, their faults, windows and frequency responses."""
