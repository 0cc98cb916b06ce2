"""The lock: when it counts as gained and as lost."""
