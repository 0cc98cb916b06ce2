"""Benchmarks; nothing here is installed."""
