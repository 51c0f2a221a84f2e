"""Where MuJoCo's ball breaks: failure maps over pairs of axes, with the predicted edges on them."""
