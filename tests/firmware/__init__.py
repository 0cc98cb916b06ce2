"""The firmware as it is built: devices in C, run as processes."""
