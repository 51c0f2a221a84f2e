"""Show motions: notebook cells, films, and web pages to orbit and play."""
