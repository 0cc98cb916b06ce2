"""Analysis without a test: frequency responses, and periodic vibrations of the coupled rig by harmonic balance."""
