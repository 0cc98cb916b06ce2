"""The bench: drivers, the loop, campaigns, recordings, figures and the command line."""
