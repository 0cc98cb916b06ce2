"""The laws within the tick: their error, their frequency, their amplitude, and how one takes over from another."""
