"""What there is to look up: keys, commands, messages and public names, as the code has them, and their pages on the site."""
