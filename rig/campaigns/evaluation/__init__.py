"""From the recorded rows of a point to its result and its quality: what several kinds of campaigns share."""
