"""The loop: a session with a bench, the loop in this process or in one of its own, and what this machine can promise."""
