"""The campaign of the paper on a virtual rig: recordings, models of all levels, error tables, predictions against the truth."""
