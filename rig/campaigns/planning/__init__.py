"""Plans: fields common to all plans, levels, knowledge of the plant, and checks before anything moves."""
