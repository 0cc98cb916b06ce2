"""Simulation of structured models together with an exciter, from its voltage."""
