"""Figures as data: skeletons, poses, clips and what deforms a mesh; numpy only, no GPU."""
