"""Campaigns: plans as data, and the one runner that carries them out."""
