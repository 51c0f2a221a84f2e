"""What things cost: ratios in one run, set-up outside the clock."""
