"""One factor graph over all platform poses and wall lines."""
