"""The ordered tick: measure, estimate, decide, act, one telemetry row; the same for every driver."""
