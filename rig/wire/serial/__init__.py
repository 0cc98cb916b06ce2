"""The wire protocol over serial lines: frames of COBS and CRC-32, and links over ports and pseudo-terminals."""
