"""What things in a scene share: anchors, casters, lights, buffers, picking."""
