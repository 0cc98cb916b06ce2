"""Campaigns: plans as data, and the one runner that carries out all of them."""
