"""How many numbers a vector of `vibrolock.lanes` has, for those who lay out arrays and call no kernel."""

WIDTH = 8  # number of double-precision numbers in a vector; chosen
