"""The multisine campaign."""
