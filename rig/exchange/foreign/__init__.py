"""Readers of binary formats of other programs; a child process runs them (`rig.exchange.process`)."""
