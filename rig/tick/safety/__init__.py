"""Safety between the law and the actuator: limits, arming, trip, latch, and the one ramp that ends every run."""
