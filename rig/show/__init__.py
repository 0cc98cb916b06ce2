"""What is in a file: as numbers, as tables, as a figure."""
