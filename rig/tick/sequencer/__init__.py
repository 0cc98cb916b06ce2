"""The sequencer: executes the segments of a plan sample by sample, as part of the tick."""
