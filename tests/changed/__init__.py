"""`pytest --changed`: the tests that can depend on what changed."""
