"""The loop: a session with a bench, the loop in this or in a separate process, and the timing of this machine."""
