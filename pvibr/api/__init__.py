"""What users reach: ``plotter.ibr``, ``mesh.ibr``, ``attach``, and the pipeline of a subplot."""
