"""Backbones measured with other systems."""
