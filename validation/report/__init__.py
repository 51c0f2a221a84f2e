"""Reports: self-contained HTML pages with words, numbers, plots and a view."""
