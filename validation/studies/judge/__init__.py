"""Anybody's trajectory held against the equations, and what is wrong with its conventions."""
