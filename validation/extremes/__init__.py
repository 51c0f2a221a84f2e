"""Where it breaks: runs at the extremes."""
