"""Vector arithmetic for kernels: eight numbers side by side."""
