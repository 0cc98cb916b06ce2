"""The wire protocol of devices: its messages, how serial lines and CAN buses carry them, and a device that speaks it."""
