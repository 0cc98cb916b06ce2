"""Free decays: modal frequency and damping over the amplitude, from one ring-down."""
