"""The health check of a bench before a test: noise, dead and swapped channels, polarity, gains, latency."""
