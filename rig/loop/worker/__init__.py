"""The wall-clock loop: a separate process connected by a block of shared memory."""
