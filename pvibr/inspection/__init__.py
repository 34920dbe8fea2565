"""What is under the mouse, and how a frame was drawn."""
