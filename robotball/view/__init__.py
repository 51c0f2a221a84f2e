"""Draw motions without a screen: films, MuJoCo's viewer, and pages to orbit and play."""
