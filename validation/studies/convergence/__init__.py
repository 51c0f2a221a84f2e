"""Orders of convergence, and what is left when steps shrink."""
