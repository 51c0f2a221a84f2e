"""Show motions: notebook cells, films, MuJoCo's viewer, and web pages to orbit and play."""
