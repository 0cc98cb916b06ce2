"""Readers of binary formats of others. They run in a process of their own (`rig.exchange.foreign.process`)."""
