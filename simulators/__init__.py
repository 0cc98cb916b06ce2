"""The physics of shaker, stinger and structure: a virtual rig sample by sample."""
