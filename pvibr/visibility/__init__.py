"""What cameras and lights see of surfaces, as data; no plotter is needed."""
