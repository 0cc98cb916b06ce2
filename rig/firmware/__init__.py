"""The compiled tick for other processors: the loop's own kernels as an object file and a C header."""
