"""Structured models."""
