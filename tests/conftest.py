"""What all tests share."""

from hypothesis import settings

# Shared machines and the first compilation of a kernel make any deadline a coin toss; speed is measured in benchmarks/.
settings.register_profile("no deadline", deadline=None, print_blob=True)
settings.load_profile("no deadline")
