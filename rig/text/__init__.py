"""Text output: printable text for a terminal, tables and JSON."""
