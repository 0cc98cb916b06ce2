"""One self-contained HTML page on a test: recordings, checks, models, their comparison, or a study of the paper."""
