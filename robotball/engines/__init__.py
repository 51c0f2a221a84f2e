"""The engines, a file or a room each; none knows another. `robotball.dispatch` lists them."""
