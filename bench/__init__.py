"""Measurements of cost: ratios in one run, set-up outside the clock."""
