"""What accuracy costs: every choice of the recipe, its error and its time."""
