"""The protocol on a serial line: COBS frames with CRC-32."""
