"""Closed-loop tests of a bench, the same for virtual, emulated and real ones: ``pytest --pyargs rig.hil --rig-bench BENCH``."""
