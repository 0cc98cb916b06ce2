"""Studies with the product: papers reproduced, ways to run and methods compared. A distribution of its own."""
