"""What the benches share: the harness, timing, plots, scenes, references and peers."""
