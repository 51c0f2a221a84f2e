"""Benchmarks and generators of docs."""
