"""The response-controlled campaign."""
