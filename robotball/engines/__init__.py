"""The engines, a file or a room each; none knows another. `robotball.engine` lists them."""
