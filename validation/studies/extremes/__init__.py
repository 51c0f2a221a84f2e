"""Where MuJoCo's ball breaks: failure maps over pairs of axes, and random runs far out."""
