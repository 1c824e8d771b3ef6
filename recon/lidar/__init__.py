"""2D LiDAR: line segments, Manhattan directions, scan matching."""
