"""The sequencer: segments of a plan, executed by the sample beside the tick."""
