"""Runs where disk, folder, name, locale or clock are not as they should be: nothing is lost, and one line says why."""
