"""Reproduction of the paper's campaign on a virtual rig: recordings, models at all levels, error tables, predictions."""
