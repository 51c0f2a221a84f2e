"""Two motions of a scene compared: agreement, sensitivity, tables, plots, results."""
