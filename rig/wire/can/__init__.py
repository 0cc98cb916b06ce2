"""The protocol on a CAN bus, classical and FD, as a DBC file defines it."""
