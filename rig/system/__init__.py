"""What the operating system gives: files written whole, locks, child processes, signals, privileges."""
