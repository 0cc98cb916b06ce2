"""What all tests share."""

import os

from hypothesis import settings

# Shared machines and the first compilation of a kernel make any deadline a coin toss; speed is measured in benchmarks/.
# Examples are the same on every machine and in every run: what one finds is found again. HYPOTHESIS_SEARCH=1 seeks others.
settings.register_profile(
    "repeatable", deadline=None, print_blob=True, derandomize="HYPOTHESIS_SEARCH" not in os.environ
)
settings.load_profile("repeatable")
