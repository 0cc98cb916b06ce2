"""Universal files: dataset 58 for functions, 55 for mode shapes, 151 and 164 for header and units."""
