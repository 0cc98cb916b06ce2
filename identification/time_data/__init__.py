"""Time records measured by others: what they hold, and the experiments and frequency responses that come of them."""
