"""Show the contents of a file as numbers, as tables or as a figure."""
