"""Images: edges, line segments, vanishing points, ground-wall boundary candidates."""
