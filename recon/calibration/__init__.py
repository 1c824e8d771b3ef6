"""Camera to platform: top-down homography, 2D similarity, recursive RANSAC, joint refinement."""
