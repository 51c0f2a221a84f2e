"""What each modelling choice is worth, and costs."""
