"""Bodies that realise requested dynamics, and drives that realise a requested path."""
