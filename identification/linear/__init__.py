"""Linear frequency responses and what a modal analysis makes of them."""
