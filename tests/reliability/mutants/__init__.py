"""One expression of the product changed at a time: do the tests notice? See decision 0094."""
