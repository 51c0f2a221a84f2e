"""Find bodies that realise requested dynamics, and drives that realise a requested path."""
