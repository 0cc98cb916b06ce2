"""What stands between the physics and the samples: sensors, converters, noise."""
