"""The commands of `robotball`, a group a file."""
