"""Plans: what every plan has, levels, what may be known of the plant, and what is refused before anything moves."""
