"""Frames from hell at both ends of both wires, made from valid ones: rows are right or gaps, and the output comes to 0 V."""
