"""Whether force and motion follow the output, as the plant, known or just measured, says."""
