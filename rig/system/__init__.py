"""Services of the operating system: files written whole, locks, child processes, signals, privileges."""
