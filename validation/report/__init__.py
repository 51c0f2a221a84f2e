"""One HTML page of what was run: words, numbers, plots and a view, with no need of a network."""
