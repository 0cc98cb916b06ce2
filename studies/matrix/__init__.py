"""Ways to run a test, side by side: what each was measured to do, and what was verified of it (``rig doctor --matrix``)."""
