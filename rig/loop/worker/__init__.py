"""The wall-clock loop: a process of its own behind a block of shared memory."""
