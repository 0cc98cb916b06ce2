"""Text for people: what a terminal can show, tables, progress."""
